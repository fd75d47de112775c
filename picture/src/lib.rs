//! Pictures from plain numbers: clouds of points coloured by a value, line plots, and the PNG files they go to.
//!
//! The same input gives the same pixels on every machine and any number of threads: the font lies in the program, and
//! each thread draws a part of its own. No number stops a picture from being drawn: what cannot be shown is left out.
//!
//! | wanted | use |
//! |---|---|
//! | points on a line, in a plane or in space, one colour each | [`picture::draw`] |
//! | series over common axes | [`plot::draw_plot`] |
//! | an image as a file, several as one that plays | [`picture::write_png`], [`picture::write_animation`] |
//! | any file, whole or not at all | [`files::write_whole`] |
//!
//! Deliberately absent: what the numbers mean, where they come from and when they are drawn; windows; formats other
//! than PNG.

mod axes;
mod canvas;
mod cubes;
pub mod files;
pub mod picture;
pub mod plot;
mod relief;
mod solid;
mod ticks;
