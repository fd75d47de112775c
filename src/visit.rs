//! Everything that changes in a run, handed over by name: what a checkpoint stores, what counts as the state.

/// Is shown every array and number that changes in a run, and may replace it.
///
/// Whoever has state shows all of it, in the same order whenever it is asked, under names that do not depend on what
/// stands around it. What follows from the case alone, or from what is shown, is not shown.
pub trait Visitor {
    fn doubles(&mut self, name: &str, values: &mut Vec<f64>);
    fn singles(&mut self, name: &str, values: &mut Vec<f32>);
    /// Bits.
    fn words(&mut self, name: &str, values: &mut Vec<u16>);
    fn indices(&mut self, name: &str, values: &mut Vec<u32>);
    fn number(&mut self, name: &str, value: &mut f64);
    fn count(&mut self, name: &str, value: &mut u64);
    fn flag(&mut self, name: &str, value: &mut bool) {
        let mut count = u64::from(*value);
        self.count(name, &mut count);
        *value = count != 0;
    }
}
