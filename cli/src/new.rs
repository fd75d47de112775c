//! `bondwise new`: bundled cases, copied out to be changed.

use std::path::PathBuf;
use std::process::ExitCode;

use bondwise::case::bundled;
use bondwise::expression::nearest;
use bondwise::{Error, Result};

use crate::say;

pub fn new(name: &str, folder: Option<PathBuf>) -> Result<ExitCode> {
    let Some(case) = bundled::CASES.iter().find(|c| c.name == name) else {
        let names: Vec<&str> = bundled::CASES.iter().map(|c| c.name).collect();
        let help =
            nearest(name, names.iter().copied()).map_or(String::new(), |n| format!("\n    help: did you mean `{n}`?"));
        return Err(Error::Refused(format!(
            "no bundled case is called `{name}`; there are {}{help}",
            names.join(", ")
        )));
    };
    let folder = folder.unwrap_or_else(|| PathBuf::from(name));
    if folder.exists() {
        return Err(Error::Refused(format!("{}: exists already; nothing was overwritten", folder.display())));
    }
    std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
    for (file, text) in [("case.toml", case.case), ("README.md", case.readme)] {
        let path = folder.join(file);
        std::fs::write(&path, text).map_err(|e| Error::io(&path, e))?;
    }
    say!("made {}; run it with: bondwise run {}", folder.display(), folder.display());
    Ok(ExitCode::SUCCESS)
}
