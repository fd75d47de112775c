//! Proof: closed forms, published figures and studies that compare the program with them.
pub mod discrete;
