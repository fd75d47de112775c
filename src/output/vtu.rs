//! Point clouds as VTK files, for ParaView and PyVista.
//!
//! A frame is an unstructured grid (`.vtu`) with one vertex cell per point, so
//! that filters which work on cells see the points too. Its arrays stand after
//! the XML as raw bytes, compressed in blocks that are packed in parallel; those
//! that all frames of a cloud share are packed once. A series of frames is a
//! `.pvd` file that lists their times and names.
//!
//! Absent on purpose: other cell types, several pieces in one file, and reading;
//! a run is continued from its checkpoint, not from its pictures.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

use bondwise_picture::files::{named, write_whole};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;

use crate::field::{Kind, TENSOR};

/// The values of one field, one entry per point.
#[derive(Clone, Copy, Debug)]
pub enum FieldData<'a> {
    Scalar(&'a [f64]),
    Vector(&'a [[f64; 3]]),
    /// Symmetric: xx yy zz xy yz xz.
    Tensor(&'a [[f64; 6]]),
    /// The principal values of a tensor.
    Principal(&'a [[f64; 3]]),
    Integer(&'a [i64]),
}

/// How many bytes a real number takes in the file; integers always take eight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// About seven digits: enough to look at, half the size.
    #[default]
    Float32,
    /// Every bit of the computation.
    Float64,
}

/// What all frames of one cloud share: its points and cells, compressed.
pub struct Grid {
    count: usize,
    precision: Precision,
    points: Packed,
    connectivity: Packed,
    offsets: Packed,
    types: Packed,
}

impl Grid {
    /// * `positions`: coordinates \[m\]; in one and two dimensions the rest is zero.
    /// * `precision`: of these and of the fields.
    pub fn new(positions: &[[f64; 3]], precision: Precision) -> Self {
        const VERTEX: u8 = 1; // VTK's number of the cell type
        let count = positions.len();
        Self {
            count,
            precision,
            points: reals(positions.as_flattened(), precision),
            connectivity: integers(count, |i| i as i64),
            offsets: integers(count, |i| i as i64 + 1),
            types: Packed::new(count, 1, |range, bytes| bytes.extend(range.map(|_| VERTEX))),
        }
    }
}

/// Writes a point cloud with its fields as `.vtu`.
///
/// * `fields`: name and values; each as long as the cloud.
/// * `time`: \[s\], stored as field data `TimeValue`, where ParaView looks for it.
///
/// The file appears under its name only when it is complete. A field of the
/// wrong length, or two fields of one name, are `InvalidInput`.
pub fn write_vtu(path: &Path, grid: &Grid, fields: &[(&str, FieldData<'_>)], time: f64) -> io::Result<()> {
    let (count, precision) = (grid.count, grid.precision);
    check(count, fields).map_err(|reason| named(path, io::ErrorKind::InvalidInput, reason))?;
    let packed: Vec<Packed> = fields
        .iter()
        .map(|(_, data)| match *data {
            FieldData::Scalar(values) => reals(values, precision),
            FieldData::Vector(values) | FieldData::Principal(values) => reals(values.as_flattened(), precision),
            FieldData::Tensor(values) => reals(values.as_flattened(), precision),
            FieldData::Integer(values) => integers(count, |i| values[i]),
        })
        .collect();
    let mut appended = Appended::default();
    let mut xml = String::from(concat!(
        "<?xml version=\"1.0\"?>\n",
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"",
        " header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n",
        "<UnstructuredGrid>\n"
    ));
    // Writing to a String cannot fail, hence the `let _` from here on.
    let _ = writeln!(
        xml,
        "<FieldData>\n<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" \
         format=\"ascii\">{time:e}</DataArray>\n</FieldData>\n\
         <Piece NumberOfPoints=\"{count}\" NumberOfCells=\"{count}\">\n<PointData>"
    );
    for ((name, data), packed) in fields.iter().zip(&packed) {
        // Names of components only where they are not those that every reader gives them.
        let (kind, components, names): (_, _, &[&str]) = match data {
            FieldData::Scalar(_) => (precision.name(), 1, &[]),
            FieldData::Vector(_) => (precision.name(), 3, &[]),
            FieldData::Tensor(_) => (precision.name(), 6, &TENSOR),
            FieldData::Principal(_) => (precision.name(), 3, Kind::Principal.components(3)),
            FieldData::Integer(_) => ("Int64", 1, &[]),
        };
        let mut attributes = escaped(name).into_owned();
        for (k, name) in names.iter().enumerate() {
            let _ = write!(attributes, "\" ComponentName{k}=\"{name}");
        }
        appended.push(&mut xml, &attributes, kind, components, packed);
    }
    xml.push_str("</PointData>\n<Points>\n");
    appended.push(&mut xml, "Points", precision.name(), 3, &grid.points);
    xml.push_str("</Points>\n<Cells>\n");
    appended.push(&mut xml, "connectivity", "Int64", 1, &grid.connectivity);
    appended.push(&mut xml, "offsets", "Int64", 1, &grid.offsets);
    appended.push(&mut xml, "types", "UInt8", 1, &grid.types);
    xml.push_str("</Cells>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n   _");
    write_whole(path, |file| {
        file.write_all(xml.as_bytes())?;
        for packed in &appended.arrays {
            file.write_all(&packed.header)?;
            for block in &packed.blocks {
                file.write_all(block)?;
            }
        }
        file.write_all(b"\n</AppendedData>\n</VTKFile>\n")
    })
}

/// Writes the `.pvd` file that makes a time series of `.vtu` files.
///
/// * `frames`: time \[s\] and file, named relative to the folder of `path`.
///
/// It is small and replaced in one step, so rewrite it after each frame: a run
/// that stops early then leaves a series that opens.
pub fn write_pvd(path: &Path, frames: &[(f64, String)]) -> io::Result<()> {
    let mut xml = String::from(concat!(
        "<?xml version=\"1.0\"?>\n",
        "<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n",
        "<Collection>\n"
    ));
    for (time, file) in frames {
        let file = escaped(file);
        let _ = writeln!(xml, "<DataSet timestep=\"{time:e}\" group=\"\" part=\"0\" file=\"{file}\"/>");
    }
    xml.push_str("</Collection>\n</VTKFile>\n");
    write_whole(path, |file| file.write_all(xml.as_bytes()))
}

impl Precision {
    fn name(self) -> &'static str {
        match self {
            Self::Float32 => "Float32",
            Self::Float64 => "Float64",
        }
    }
}

impl FieldData<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Scalar(values) => values.len(),
            Self::Vector(values) | Self::Principal(values) => values.len(),
            Self::Tensor(values) => values.len(),
            Self::Integer(values) => values.len(),
        }
    }
}

fn check(count: usize, fields: &[(&str, FieldData<'_>)]) -> Result<(), String> {
    for (i, (name, data)) in fields.iter().enumerate() {
        let length = data.len();
        if length != count {
            return Err(format!("field `{name}` has {length} values, the cloud has {count} points"));
        }
        if fields[..i].iter().any(|(other, _)| other == name) {
            return Err(format!("two fields are named `{name}`"));
        }
    }
    Ok(())
}

/// The arrays that follow the XML, and how far they reach.
#[derive(Default)]
struct Appended<'a> {
    arrays: Vec<&'a Packed>,
    length: usize,
}

impl<'a> Appended<'a> {
    fn push(&mut self, xml: &mut String, name: &str, kind: &str, components: usize, data: &'a Packed) {
        let _ = writeln!(
            xml,
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" \
             format=\"appended\" offset=\"{}\"/>",
            self.length
        );
        self.length += data.header.len() + data.blocks.iter().map(Vec::len).sum::<usize>();
        self.arrays.push(data);
    }
}

/// One array, compressed. The header counts, in `u64`: the blocks, the bytes of
/// a whole block, the bytes of a last shorter one (zero if there is none), and
/// the compressed bytes of each block.
struct Packed {
    header: Vec<u8>,
    blocks: Vec<Vec<u8>>,
}

/// Large enough that the reader is not slowed by many small calls, small enough
/// to keep all threads busy at 1e5 points.
const BLOCK_BYTES: usize = 1 << 18;

impl Packed {
    /// Packs `count` items of `size` bytes; `fill` appends the bytes of a range of items.
    fn new(count: usize, size: usize, fill: impl Fn(Range<usize>, &mut Vec<u8>) + Sync) -> Self {
        let per_block = BLOCK_BYTES / size;
        let blocks: Vec<Vec<u8>> = (0..count.div_ceil(per_block))
            .into_par_iter()
            .map(|block| {
                let first = block * per_block;
                let range = first..count.min(first + per_block);
                let mut bytes = Vec::with_capacity(range.len() * size);
                fill(range, &mut bytes);
                compressed(&bytes)
            })
            .collect();
        let rest = count % per_block * size;
        let sizes = [blocks.len(), BLOCK_BYTES, rest];
        let header = sizes
            .into_iter()
            .chain(blocks.iter().map(Vec::len))
            .flat_map(|number| (number as u64).to_le_bytes())
            .collect();
        Self { header, blocks }
    }
}

fn reals(values: &[f64], precision: Precision) -> Packed {
    match precision {
        Precision::Float32 => Packed::new(values.len(), 4, |range, bytes| {
            bytes.extend(values[range].iter().flat_map(|&v| (v as f32).to_le_bytes()));
        }),
        Precision::Float64 => Packed::new(values.len(), 8, |range, bytes| {
            bytes.extend(values[range].iter().flat_map(|v| v.to_le_bytes()));
        }),
    }
}

fn integers(count: usize, value: impl Fn(usize) -> i64 + Sync) -> Packed {
    Packed::new(count, 8, |range, bytes| {
        bytes.extend(range.flat_map(|i| value(i).to_le_bytes()));
    })
}

/// Bytes of a block that are tried first.
const PROBE: usize = 1 << 14;

/// In zlib's format. The digits of real numbers are mostly noise, which takes long to compress and hardly shrinks: blocks
/// that begin so are stored as they are.
fn compressed(bytes: &[u8]) -> Vec<u8> {
    let packed = |bytes: &[u8], level| {
        let mut encoder = ZlibEncoder::new(Vec::with_capacity(bytes.len() + 64), level);
        encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("a Vec takes every byte")
    };
    let probe = &bytes[..bytes.len().min(PROBE)];
    let shrinks = packed(probe, Compression::fast()).len() < probe.len() / 4 * 3;
    packed(bytes, if shrinks { Compression::fast() } else { Compression::none() })
}

/// Text that may stand in an XML attribute. Control characters, which XML has no way to write, become `_`.
fn escaped(text: &str) -> Cow<'_, str> {
    let special = |c: char| matches!(c, '&' | '<' | '>' | '"') || c.is_control();
    if !text.contains(special) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push('_'),
            c => out.push(c),
        }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::tests::folder;
    use flate2::read::ZlibDecoder;
    use std::fs;
    use std::io::Read;

    /// The bytes of the array at the offset that the XML gives for `name`.
    fn array(file: &[u8], name: &str) -> Vec<u8> {
        let mark = b"<AppendedData encoding=\"raw\">\n   _";
        let start = file.windows(mark.len()).position(|w| w == mark).unwrap();
        let xml = std::str::from_utf8(&file[..start]).unwrap();
        let line = xml.lines().find(|l| l.contains(&format!("Name=\"{name}\"")));
        let offset = line.unwrap().split("offset=\"").nth(1).unwrap();
        let offset: usize = offset.split('"').next().unwrap().parse().unwrap();
        let data = &file[start + mark.len() + offset..];
        let number = |i: usize| u64::from_le_bytes(data[8 * i..8 * i + 8].try_into().unwrap()) as usize;
        let mut at = 8 * (3 + number(0));
        let mut bytes = Vec::new();
        for block in 0..number(0) {
            let part = &data[at..at + number(3 + block)];
            let before = bytes.len();
            ZlibDecoder::new(part).read_to_end(&mut bytes).unwrap();
            let last_and_short = block + 1 == number(0) && number(2) > 0;
            let expected = if last_and_short { number(2) } else { number(1) };
            assert_eq!(bytes.len() - before, expected);
            at += part.len();
        }
        bytes
    }

    #[test]
    fn every_number_comes_back_for_counts_around_the_block_size() {
        let folder = folder("vtu");
        let per_block = BLOCK_BYTES / 8;
        for count in [0, 1, per_block - 1, per_block, per_block + 1, 3 * per_block] {
            let path = folder.join("frame.vtu");
            let positions: Vec<_> = (0..count).map(|i| [i as f64, 0.1, -1e-300]).collect();
            let damage: Vec<_> = (0..count).map(|i| 1.0 / (i as f64 + 3.0)).collect();
            let stresses: Vec<_> = (0..count).map(|i| [i as f64, 0.1, -1e-300, 3.0, 4.0, 5.0]).collect();
            let marks: Vec<_> = (0..count).map(|i| i as i64 - 7).collect();
            let fields = [
                ("damage", FieldData::Scalar(&damage)),
                ("mark", FieldData::Integer(&marks)),
                ("stress", FieldData::Tensor(&stresses)),
                ("velocity", FieldData::Vector(&positions)),
            ];
            write_vtu(&path, &Grid::new(&positions, Precision::Float64), &fields, 1e-6).unwrap();
            let file = fs::read(&path).unwrap();
            let real = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().unwrap());
            let read: Vec<f64> = array(&file, "damage").chunks(8).map(real).collect();
            assert_eq!(read, damage);
            let read: Vec<f64> = array(&file, "stress").chunks(8).map(real).collect();
            assert_eq!(read, stresses.as_flattened());
            let head = String::from_utf8_lossy(&file[..file.len().min(4096)]).into_owned();
            let tensor = head.lines().find(|line| line.contains("Name=\"stress\"")).unwrap();
            assert!(tensor.contains("NumberOfComponents=\"6\""), "{tensor}");
            for (k, name) in TENSOR.iter().enumerate() {
                assert!(tensor.contains(&format!("ComponentName{k}=\"{name}\"")), "{tensor}");
            }
            let read: Vec<f64> = array(&file, "Points").chunks(8).map(real).collect();
            assert_eq!(read, positions.as_flattened());
            assert_eq!(array(&file, "velocity"), array(&file, "Points"));
            let read: Vec<i64> =
                array(&file, "mark").chunks(8).map(|bytes| i64::from_le_bytes(bytes.try_into().unwrap())).collect();
            assert_eq!(read, marks);
            assert_eq!(array(&file, "types"), vec![1; count]);
        }
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn single_precision_rounds_and_keeps_nan() {
        let folder = folder("vtu32");
        let path = folder.join("frame.vtu");
        let values = [0.1, f64::NAN];
        let fields = [("a<b>&\"c\"", FieldData::Scalar(&values))];
        write_vtu(&path, &Grid::new(&[[0.0; 3]; 2], Precision::Float32), &fields, 0.0).unwrap();
        let bytes = array(&fs::read(&path).unwrap(), "a&lt;b&gt;&amp;&quot;c&quot;");
        let read: Vec<f32> = bytes.chunks(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect();
        assert_eq!(read[0], 0.1_f32);
        assert!(read[1].is_nan());
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_field_of_the_wrong_length_or_a_name_twice_is_refused_in_words() {
        let path = Path::new("/no/such/folder/frame.vtu");
        let short = FieldData::Scalar(&[1.0]);
        let write = |fields: &[(&str, FieldData<'_>)]| {
            write_vtu(path, &Grid::new(&[[0.0; 3]; 2], Precision::Float64), fields, 0.0).unwrap_err().to_string()
        };
        let said = write(&[("damage", short)]);
        assert!(said.contains("frame.vtu: field `damage` has 1 values"), "{said}");
        let full = FieldData::Scalar(&[1.0, 2.0]);
        let said = write(&[("u", full), ("u", full)]);
        assert!(said.contains("two fields are named `u`"), "{said}");
    }

    #[test]
    fn a_series_lists_times_that_parse_back_exactly() {
        let folder = folder("pvd");
        let path = folder.join("run.pvd");
        let frames = [(0.0, "run_0.vtu".to_owned()), (1.0 / 3e7, "a&b.vtu".to_owned())];
        write_pvd(&path, &frames).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let times: Vec<f64> =
            text.split("timestep=\"").skip(1).map(|rest| rest.split('"').next().unwrap().parse().unwrap()).collect();
        assert_eq!(times, [0.0, 1.0 / 3e7]);
        assert!(text.contains("file=\"a&amp;b.vtu\""));
        fs::remove_dir_all(folder).unwrap();
    }
}
