//! Listing: the names in a folder of `data`, one at a time, so that a folder of any size needs the same memory.

use super::confine;
use std::path::Path;
use takt_abi::{Chunk, HostError};

/// The entry that follows the one whose name is in `buffer`; its name, and the size of a file.
pub(super) fn next(data: &Path, path: &str, mut buffer: Vec<u8>) -> Result<Chunk, HostError> {
    let folder = match path {
        "." | "./" => data.canonicalize().map_err(confine::error)?,
        path => confine::resolve(data, path.strip_suffix('/').unwrap_or(path))?,
    };
    let last = std::str::from_utf8(&buffer).unwrap_or_default().trim_end_matches('/').to_string();
    let mut best: Option<(String, std::fs::Metadata)> = None;
    for entry in std::fs::read_dir(folder).map_err(confine::error)? {
        let entry = entry.map_err(confine::error)?;
        let Ok(name) = entry.file_name().into_string() else { continue };
        let closer = name.len() < 255 && name > last && best.as_ref().is_none_or(|(found, _)| name < *found);
        // The entry itself, not what a link leads to: that may lie outside.
        if closer && let Ok(meta) = entry.metadata() {
            best = Some((name, meta));
        }
    }
    buffer.clear();
    let Some((name, meta)) = best else { return Ok(Chunk { data: buffer, file_size: 0 }) };
    buffer.extend_from_slice(name.as_bytes());
    if meta.is_dir() {
        buffer.push(b'/');
    }
    Ok(Chunk { data: buffer, file_size: if meta.is_file() { meta.len() } else { 0 } })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_in_order_and_none_from_outside() {
        let root = std::env::temp_dir().join(format!("takt-list-{}", std::process::id()));
        let data = root.join("data");
        std::fs::create_dir_all(data.join("b")).unwrap();
        std::fs::write(data.join("c.txt"), "123").unwrap();
        std::fs::write(data.join("a"), "").unwrap();
        let names = |path: &str| {
            let (mut last, mut all) = (Vec::new(), Vec::new());
            loop {
                let chunk = next(&data, path, last)?;
                if chunk.data.is_empty() {
                    return Ok(all);
                }
                all.push((String::from_utf8(chunk.data.clone()).unwrap(), chunk.file_size));
                last = chunk.data;
            }
        };
        let expected = [("a", 0), ("b/", 0), ("c.txt", 3)].map(|(name, size)| (name.to_string(), size)).to_vec();
        assert_eq!((names("."), names("./")), (Ok(expected.clone()), Ok(expected)));
        assert_eq!((names("b"), names("./b/")), (Ok(vec![]), Ok(vec![])));
        for (path, error) in
            [("..", HostError::Outside), ("/", HostError::Outside), ("none", HostError::NotFound), ("a", HostError::NotFound)]
        {
            assert_eq!(names(path), Err(error), "{path}");
        }
        std::fs::remove_dir_all(root).unwrap();
    }
}
