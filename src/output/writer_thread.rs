//! The thread that writers run on, so that the run steps on while files are formatted, compressed and drawn.
//!
//! It takes batches in order through a channel that holds one: with the batch that is being written and the one being
//! handed over, no more than three instants are ever in memory. Deliberately not here: any look at the model.

use std::any::Any;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{Builder, JoinHandle};
use std::time::Instant;

use super::snapshot::Snapshot;
use super::table::Table;
use super::writer::Writer;
use crate::error::{Error, Result};

/// What is to be written of one instant: the row of the history first, then the snapshots in their order.
#[derive(Default)]
pub struct Batch {
    pub row: Option<Vec<f64>>,
    /// With the number of the writer.
    pub snapshots: Vec<(usize, Snapshot)>,
}

/// Numbers that may wait beside the channel: rows and probes never make a run wait for a frame.
const BACKLOG: usize = 1 << 16;

/// The writer thread of a run, as the stepping thread sees it.
pub struct WriterThread {
    /// None when the thread has been told to end.
    channel: Option<SyncSender<Vec<Batch>>>,
    /// None when it has ended.
    thread: Option<JoinHandle<Result<f64>>>,
    /// What found no place in the channel yet.
    backlog: Vec<Batch>,
    folder: PathBuf,
}

impl WriterThread {
    /// Starts the thread; the writers share a pool of `threads` threads of their own. `folder` is named in errors that
    /// are about no single file.
    pub fn start(history: Table, writers: Vec<Box<dyn Writer>>, threads: usize, folder: &Path) -> Result<Self> {
        let refused = |e: &dyn std::fmt::Display| Error::Refused(format!("threads: {e}"));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| refused(&e))?;
        let (channel, inbox) = sync_channel(1);
        let thread = Builder::new()
            .name("writer".into())
            .spawn(move || pool.install(move || write_all(inbox, history, writers)))
            .map_err(|e| refused(&e))?;
        let folder = folder.to_path_buf();
        Ok(WriterThread { channel: Some(channel), thread: Some(thread), backlog: Vec::new(), folder })
    }

    /// Hands over what is to be written, and waits if the writers are more than an instant behind. An error of an
    /// earlier batch comes out here.
    pub fn hand(&mut self, batch: Batch) -> Result<()> {
        self.backlog.push(batch);
        let Some(channel) = &self.channel else { return Ok(()) };
        let batches = std::mem::take(&mut self.backlog);
        let sent = if batches.iter().map(Batch::numbers).sum::<usize>() > BACKLOG {
            channel.send(batches).is_ok()
        } else {
            match channel.try_send(batches) {
                Err(TrySendError::Full(batches)) => {
                    self.backlog = batches;
                    true
                }
                sent => sent.is_ok(),
            }
        };
        if sent { Ok(()) } else { self.join().map(drop) }
    }

    /// The error of the writers, if they have met one.
    pub fn check(&mut self) -> Result<()> {
        if self.thread.as_ref().is_some_and(JoinHandle::is_finished) { self.join().map(drop) } else { Ok(()) }
    }

    /// Waits until all is written; returns the seconds that the thread was busy.
    pub fn finish(mut self) -> Result<f64> {
        if let Some(channel) = &self.channel {
            // A thread that has ended takes nothing; why it has, `join` tells.
            let _ = channel.send(std::mem::take(&mut self.backlog));
        }
        self.join()
    }

    fn join(&mut self) -> Result<f64> {
        self.channel = None;
        match self.thread.take().map(JoinHandle::join) {
            None => Ok(0.0),
            Some(Ok(end)) => end,
            Some(Err(panic)) => {
                let reason = format!("writing results failed, by a mistake of the program: {}", words(&*panic));
                Err(Error::io(&self.folder, io::Error::other(reason)))
            }
        }
    }
}

/// A run that ends early leaves no thread behind; what was handed over is written.
impl Drop for WriterThread {
    fn drop(&mut self) {
        let _ = self.join();
    }
}

impl Batch {
    pub fn is_empty(&self) -> bool {
        self.row.is_none() && self.snapshots.is_empty()
    }

    fn numbers(&self) -> usize {
        self.row.as_ref().map_or(0, Vec::len) + self.snapshots.iter().map(|(_, s)| s.numbers()).sum::<usize>()
    }
}

/// The work of the thread, until the channel is closed or a writer fails.
fn write_all(inbox: Receiver<Vec<Batch>>, mut history: Table, mut writers: Vec<Box<dyn Writer>>) -> Result<f64> {
    let mut busy = 0.0;
    for batches in inbox {
        let begin = Instant::now();
        for Batch { row, snapshots } in batches {
            if let Some(row) = row {
                history.row(&row)?;
            }
            for (k, snapshot) in snapshots {
                writers[k].write(&snapshot)?;
            }
        }
        busy += begin.elapsed().as_secs_f64();
    }
    Ok(busy)
}

/// What a panic says.
fn words(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no reason given")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{Field, Values};
    use crate::output::snapshot::FieldRequest;
    use crate::output::source::{BodySummary, ElasticSummary, PhysicsSummary, Points};
    use crate::output::tests::folder;
    use crate::physics::elasticity::surface::SurfaceEffect;
    use crate::solver::Clock;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc::channel;
    use std::time::Duration;

    /// A writer that is a closure.
    struct Act<F>(F);

    impl<F: FnMut(&Snapshot) -> Result<()> + Send> Writer for Act<F> {
        fn wants(&self) -> FieldRequest {
            FieldRequest::default()
        }
        fn write(&mut self, snapshot: &Snapshot) -> Result<()> {
            (self.0)(snapshot)
        }
    }

    fn thread(name: &str, write: impl FnMut(&Snapshot) -> Result<()> + Send + 'static) -> WriterThread {
        let folder = folder(name);
        let table = Table::new(&folder.join("history.csv"), vec!["step".into()]);
        WriterThread::start(table, vec![Box::new(Act(write))], 1, &folder).unwrap()
    }

    /// A snapshot of so many numbers.
    fn snapshot(step: u64, numbers: usize) -> Snapshot {
        let facts = BodySummary {
            dimension: 3,
            points: 0,
            bonds: 0,
            cut_bonds: 0,
            horizon: 1.0,
            spacing: 1.0,
            volume: 1.0,
            shape_volume: None,
            mass: None,
            stable_step: 1.0,
            physics: PhysicsSummary::Elastic(ElasticSummary {
                bar_speed: 1.0,
                rayleigh_speed: None,
                materials: Vec::new(),
                micromodulus: 1.0,
                critical_stretch: None,
                surface: SurfaceEffect::default(),
            }),
            memory: 0,
        };
        let points = Arc::new(Points { positions: Vec::new(), sizes: Vec::new(), facts });
        let fields = vec![Arc::new(Field { name: "damage", unit: "", values: Values::Scalar(vec![0.0; numbers]) })];
        Snapshot { clock: Clock::at(step, 1.0), points, fields, resultant: None }
    }

    fn heavy(step: u64) -> Batch {
        Batch { row: None, snapshots: vec![(0, snapshot(step, BACKLOG + 1))] }
    }

    /// Hands over until something comes back.
    fn error_of(mut thread: WriterThread) -> Error {
        for step in 0..100 {
            if let Err(error) = thread.hand(heavy(step)) {
                assert!(thread.hand(heavy(step)).is_ok(), "an error is told once");
                return error;
            }
        }
        panic!("a hundred batches went to a writer that fails")
    }

    #[test]
    fn the_error_of_a_writer_comes_out_in_its_own_words() {
        let full = || Error::io("/a/b.vtu", io::Error::other("no space left"));
        let error = error_of(thread("error", move |_| Err(full())));
        assert_eq!(error.to_string(), full().to_string());
        // Also where nothing is handed over any more.
        let mut last = thread("error", move |_| Err(full()));
        last.hand(heavy(0)).unwrap();
        assert_eq!(last.finish().unwrap_err().to_string(), full().to_string());
        let mut waiting = thread("error", move |_| Err(full()));
        waiting.hand(heavy(0)).unwrap();
        let told = (0..3000).find_map(|_| {
            std::thread::sleep(Duration::from_millis(10));
            waiting.check().err()
        });
        assert_eq!(told.unwrap().to_string(), full().to_string());
    }

    #[test]
    fn a_panic_of_a_writer_is_an_error_and_not_a_hang() {
        let error = error_of(thread("panic", |snapshot| panic!("no picture of step {}", snapshot.clock.step)));
        assert!(error.to_string().ends_with("by a mistake of the program: no picture of step 0"), "{error}");
        assert_eq!(error.exit_code(), 5);
    }

    #[test]
    fn a_run_that_ends_early_waits_for_what_it_has_handed_over() {
        let written = Arc::new(AtomicUsize::new(0));
        let count = written.clone();
        let mut slow = thread("early", move |_| {
            std::thread::sleep(Duration::from_millis(20));
            count.fetch_add(1, Ordering::SeqCst);
            Ok(())
        });
        for step in 0..4 {
            slow.hand(heavy(step)).unwrap();
        }
        drop(slow);
        assert_eq!(written.load(Ordering::SeqCst), 4);
    }

    #[test]
    fn rows_and_probes_do_not_wait_for_a_frame() {
        let (open, gate) = channel();
        let mut steps = Vec::new();
        let (done, all) = channel();
        let mut thread = thread("rows", move |snapshot| {
            if snapshot.clock.step == 0 {
                gate.recv().unwrap();
            }
            steps.push(snapshot.clock.step);
            done.send(steps.clone()).unwrap();
            Ok(())
        });
        thread.hand(heavy(0)).unwrap();
        for step in 1..200 {
            // Nothing is taken before the gate opens: a wait here would never end.
            thread.hand(Batch { row: Some(vec![step as f64]), snapshots: vec![(0, snapshot(step, 1))] }).unwrap();
        }
        open.send(()).unwrap();
        let path = thread.folder.join("history.csv");
        thread.finish().unwrap();
        assert_eq!(all.iter().last().unwrap(), (0..200).collect::<Vec<_>>(), "in the order of time");
        assert_eq!(std::fs::read_to_string(path).unwrap().lines().count(), 200);
    }
}
