//! Point clouds from CSV tables: columns `x`, `y`, `z` (as many as the dimension), `volume`, optionally `sets`.
//!
//! Columns are found by name, in any order; others are refused. Values are in SI units. The names in `sets` are
//! joined by `+`. Lines that start with `#` are comments.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;

use crate::case::diagnostics::shorten;
use crate::error::{Error, Result};
use crate::field::Vector;

/// Largest table that is read.
const LARGEST: u64 = 8 << 30;

/// The points of a table: positions (m), volumes (m³, m² or m), and the point indices of each named set.
#[derive(Debug, Clone, PartialEq)]
pub struct Points<const D: usize> {
    pub positions: Vec<Vector<D>>,
    pub volumes: Vec<f64>,
    pub sets: BTreeMap<String, Vec<u32>>,
}

/// Of the mistakes of a table, so many are said one by one.
const MISTAKES: usize = 20;

/// Reads a table; every refusal names file, line, column and cell, and all mistakes of the lines are said at once. Columns of axes that
/// the dimension does not have may hold zeros.
pub fn read<const D: usize>(path: &Path) -> Result<Points<D>> {
    let refuse = |line: u64, message: String| Error::Refused(format!("{}:{line}: error: {message}", path.display()));
    let metadata = std::fs::metadata(path).map_err(|e| Error::Refused(format!("{}: {e}", path.display())))?;
    if !metadata.is_file() || metadata.len() > LARGEST {
        return Err(Error::Refused(format!("{}: is not a regular file of at most {LARGEST} bytes", path.display())));
    }
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .flexible(true)
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(|e| Error::Refused(format!("{}: {e}", path.display())))?;
    let headers = reader.headers().map_err(|e| refuse(1, e.to_string()))?.clone();
    let names = &["x", "y", "z"][..D];
    let known: Vec<&str> = names.iter().copied().chain(["volume", "sets"]).collect();
    let flat = |header: &str| ["y", "z"].contains(&header) && !names.contains(&header);
    for header in &headers {
        if !known.contains(&header) && !flat(header) {
            let hint = match header {
                _ if header.contains(';') => "; columns are separated by commas",
                _ if header.parse::<f64>().is_ok() => "; the first line must name the columns",
                _ => "",
            };
            let (header, known) = (shorten(header), known.join(", "));
            return Err(refuse(1, format!("unknown column `{header}`; known columns: {known}{hint}")));
        }
    }
    let column = |name: &str| {
        let found: Vec<usize> = (0..headers.len()).filter(|&k| &headers[k] == name).collect();
        match found[..] {
            [k] => Ok(k),
            [] if headers.is_empty() => Err(refuse(1, "the table is empty".into())),
            [] => Err(refuse(
                1,
                format!("column `{name}` is missing; found: {}", headers.iter().collect::<Vec<_>>().join(", ")),
            )),
            _ => Err(refuse(1, format!("column `{name}` stands {} times", found.len()))),
        }
    };
    let mut axes = [0; D];
    for d in 0..D {
        axes[d] = column(names[d])?;
    }
    let volume = column("volume")?;
    let set_column = headers.iter().position(|h| h == "sets");
    let flat: Vec<usize> = (0..headers.len()).filter(|&k| flat(&headers[k])).collect();
    let mut points = Points { positions: Vec::new(), volumes: Vec::new(), sets: BTreeMap::new() };
    let (mut mistakes, mut more) = (Vec::new(), 0);
    for record in reader.records() {
        let read = match record {
            Ok(record) => point(&record, &headers, (&axes, volume, set_column, &flat), &refuse),
            Err(e) => {
                let line = e.position().map_or(0, csv::Position::line);
                Err(match e.kind() {
                    csv::ErrorKind::Utf8 { .. } => refuse(line, "this line is not UTF-8".into()),
                    csv::ErrorKind::Io(e) => return Err(Error::Refused(format!("{}: {e}", path.display()))),
                    _ => refuse(line, e.to_string()),
                })
            }
        };
        match read {
            Ok((position, volume, sets)) => {
                let index = points.positions.len() as u32;
                for name in sets {
                    let set: &mut Vec<u32> = points.sets.entry(name).or_default();
                    // A name that stands twice names the point once.
                    if set.last() != Some(&index) {
                        set.push(index);
                    }
                }
                points.positions.push(position);
                points.volumes.push(volume);
            }
            Err(mistake) if mistakes.len() < MISTAKES => mistakes.push(mistake),
            Err(_) => more += 1,
        }
    }
    if !mistakes.is_empty() {
        let mut text: Vec<String> = mistakes.iter().map(Error::to_string).collect();
        if more > 0 {
            text.push(format!("and {more} lines more"));
        }
        return Err(Error::Refused(text.join("\n")));
    }
    if points.positions.is_empty() {
        return Err(refuse(1, "the table holds no points".into()));
    }
    if let Some((a, b)) = twins(&points.positions) {
        let position = points.positions[a].map(|x| x.to_string()).join(", ");
        return Err(Error::Refused(format!(
            "{}: error: points {a} and {b}, counted from 0, are in one place, ({position}) m",
            path.display()
        )));
    }
    Ok(points)
}

/// One point of a table: its position, volume and the names of its sets. `columns`: of the axes, of the volume, of the sets, and those
/// that must be zero.
#[allow(clippy::type_complexity)] // what stands in a line
fn point<const D: usize>(
    record: &csv::StringRecord,
    headers: &csv::StringRecord,
    (axes, volume, set_column, flat): (&[usize; D], usize, Option<usize>, &[usize]),
    refuse: &dyn Fn(u64, String) -> Error,
) -> Result<(Vector<D>, f64, Vec<String>)> {
    let line = record.position().map_or(0, csv::Position::line);
    if record.len() != headers.len() {
        let quote = if record.iter().any(|cell| cell.contains('\n')) { "; is a quote not closed?" } else { "" };
        let (columns, cells) = (headers.len(), record.len());
        let message = format!("the header names {columns} columns, this line has {cells}{quote}");
        return Err(refuse(line, message));
    }
    let number = |k: usize| {
        let cell = &record[k];
        match cell.parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            _ => {
                let is_comma = cell.contains(',') && cell.replacen(',', ".", 1).parse::<f64>().is_ok();
                let hint = if is_comma { "; decimals are written with a point" } else { "" };
                let (column, cell) = (&headers[k], shorten(cell));
                let message = format!("column `{column}`: found `{cell}`, where a finite number is wanted{hint}");
                Err(refuse(line, message))
            }
        }
    };
    let mut position = [0.0; D];
    for d in 0..D {
        position[d] = number(axes[d])?;
    }
    for &k in flat {
        let x = number(k)?;
        if x != 0.0 {
            let message = format!("column `{}`: found {x}, where {D}D has no such axis", &headers[k]);
            return Err(refuse(line, message));
        }
    }
    let v = number(volume)?;
    if v <= 0.0 {
        return Err(refuse(line, format!("column `volume`: found {v}, where a volume above 0 is wanted")));
    }
    let cell = set_column.map_or("", |k| &record[k]);
    let sets: Vec<String> = cell.split('+').map(str::trim).filter(|n| !n.is_empty()).map(str::to_owned).collect();
    if sets.iter().any(|name| name == "all") {
        let message = "column `sets`: the name `all` is taken: it stands for every point";
        return Err(refuse(line, message.into()));
    }
    Ok((position, v, sets))
}

/// The line of a point in a table that [`read`] has accepted.
pub fn line_of(path: &Path, point: usize) -> Option<u64> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).flexible(true).from_path(path).ok()?;
    let record = reader.records().nth(point)?.ok()?;
    record.position().map(csv::Position::line)
}

/// The first two points that are in one place: their bond would have no length.
fn twins<const D: usize>(positions: &[Vector<D>]) -> Option<(usize, usize)> {
    let mut order: Vec<usize> = (0..positions.len()).collect();
    // Adding 0 makes one zero of the two.
    let key = |&i: &usize| positions[i].map(|x| (x + 0.0).to_bits());
    order.par_sort_unstable_by_key(|i| (key(i), *i));
    order.windows(2).find(|pair| key(&pair[0]) == key(&pair[1])).map(|pair| (pair[0], pair[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Points<2>> {
        let path = std::env::temp_dir().join(format!("bondwise_csv_{}_{}.csv", std::process::id(), text.len()));
        std::fs::write(&path, text).unwrap();
        let points = read::<2>(&path);
        std::fs::remove_file(&path).unwrap();
        points
    }

    #[test]
    fn columns_are_found_by_name_and_sets_are_split() {
        let points = read_text("volume,y,x,sets\n1,2,3,a+b\n# note\n4,5,6,b\n").unwrap();
        assert_eq!(points.positions, [[3.0, 2.0], [6.0, 5.0]]);
        assert_eq!(points.volumes, [1.0, 4.0]);
        assert_eq!((&points.sets["a"], &points.sets["b"]), (&vec![0], &vec![0, 1]));
        let points = read_text("x,y,z,volume,sets\n1,2,0,3,a+a\n2,2,-0.0,3,\n").unwrap();
        assert_eq!((points.positions.len(), &points.sets["a"]), (2, &vec![0]));
    }

    #[test]
    fn mistakes_name_line_and_column() {
        for (text, expected) in [
            ("x,y,volume\n1,2,3\n1,oops,3\n", ":3: error: column `y`: found `oops`"),
            ("x,y,volume\n1,2,-3\n", "column `volume`: found -3"),
            ("x,y\n1,2\n", "column `volume` is missing"),
            ("x;y;volume\n1;2;3\n", "columns are separated by commas"),
            ("x,y,volume\n1,2\n", ":2: error"),
            ("x,y,volume\n", "no points"),
            ("x,y,volume\n1,a,3\n1,2,3\nb,2,3\n", ":4: error: column `x`: found `b`"),
            ("x,y,volume\n1,a,3\n1,2,3\nb,2,3\n", ":2: error: column `y`: found `a`"),
            ("x,y,z,volume\n1,2,0,3\n1,3,1e-3,3\n", ":3: error: column `z`: found 0.001, where 2D has no such axis"),
            ("x,y,volume,sets\n1,2,3,all\n", ":2: error: column `sets`: the name `all` is taken"),
        ] {
            let message = read_text(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
