//! The tape: a formula as a list of instructions on few registers.

use super::*;

#[derive(Debug, Clone)]
pub(super) struct Used {
    pub(super) index: usize,
    pub(super) name: String,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Operand {
    Constant(f64),
    Variable(usize),
    Register(usize),
}

impl Operand {
    #[inline]
    pub(super) fn value(self, values: &[f64], registers: &[f64; REGISTERS]) -> f64 {
        match self {
            Self::Constant(value) => value,
            Self::Variable(index) => values[index],
            Self::Register(index) => registers[index],
        }
    }
}

/// `target = operation(operands)`; operands beyond the arity are constants nobody reads.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instruction {
    pub(super) operation: Operation,
    pub(super) operands: [Operand; 3],
    pub(super) target: usize,
}

/// A node of the folded formula. Operands stand before the nodes that use them.
#[derive(Clone, Copy)]
pub(super) enum Node {
    Constant(f64),
    Variable(usize),
    Operation(Operation, [usize; 3]),
    /// Constant without a finite value; the index is into `Parser::undefined`.
    Undefined(usize),
}

/// The tape that computes `root`, and where its value is found; `None` if registers run out.
///
/// Each node computes first the operand that needs most registers, as it then waits for the others
/// in one (Sethi and Ullman 1970). A target is taken before the operands are given back, so that a
/// batch never reads and writes the same register in one instruction.
pub(super) fn emit(nodes: &[Node], root: usize) -> Option<(Vec<Instruction>, Operand)> {
    let mut needs = vec![0; nodes.len()];
    let heaviest_first = |needs: &[usize], operation: Operation, operands: [usize; 3]| {
        let mut order = operands[..operation.arity()].to_vec();
        order.sort_by_key(|&operand| std::cmp::Reverse(needs[operand]));
        order
    };
    for (index, node) in nodes.iter().enumerate() {
        if let &Node::Operation(operation, operands) = node {
            let mut waiting = 0;
            for operand in heaviest_first(&needs, operation, operands) {
                needs[index] = needs[index].max(needs[operand] + waiting);
                waiting += usize::from(needs[operand] > 0);
            }
            needs[index] = needs[index].max(waiting + 1);
        }
    }

    // Nodes before their operands, last operand first: the reverse of the order of computation.
    let mut backwards = Vec::new();
    let mut open = vec![root];
    while let Some(index) = open.pop() {
        backwards.push(index);
        if let Node::Operation(operation, operands) = nodes[index] {
            open.extend(heaviest_first(&needs, operation, operands));
        }
    }

    let mut places = vec![Operand::Constant(0.0); nodes.len()];
    let mut free = [true; REGISTERS];
    let mut tape = Vec::new();
    for &index in backwards.iter().rev() {
        places[index] = match nodes[index] {
            Node::Constant(value) => Operand::Constant(value),
            Node::Variable(variable) => Operand::Variable(variable),
            Node::Operation(operation, children) => {
                let target = free.iter().position(|&free| free)?;
                free[target] = false;
                let mut operands = [Operand::Constant(0.0); 3];
                for (operand, &child) in operands.iter_mut().zip(&children[..operation.arity()]) {
                    *operand = places[child];
                    if let Operand::Register(register) = *operand {
                        free[register] = true;
                    }
                }
                tape.push(Instruction { operation, operands, target });
                Operand::Register(target)
            }
            // An undefined operand makes its user undefined, up to the root.
            Node::Undefined(_) => unreachable!("an undefined node stands below a defined root"),
        };
    }
    Some((tape, places[root]))
}
