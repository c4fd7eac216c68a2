use super::*;
use crate::state;
use flate2::{Compression, write::GzEncoder};
use std::fs;
use std::io::Write;

struct Folder(PathBuf);
impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("takt-backup-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        for folder in ["machine/src/deep", "machine/nc", "machine/.takt", "machine/.git", "machine/target"] {
            fs::create_dir_all(path.join(folder)).unwrap();
        }
        for (file, text) in [
            ("takt.toml", "[project]\n"),
            ("src/main.st", "PROGRAM p END_PROGRAM"),
            ("src/deep/点.st", "x"),
            ("nc/part.nc", "G0 X1"),
            (".takt/retain.0", "state"),
            (".takt/lock", "4711"),
            (".git/config", "no"),
            ("target/big", "no"),
        ] {
            fs::write(path.join("machine").join(file), text).unwrap();
        }
        Self(path)
    }
    fn save(&self) -> PathBuf {
        let (machine, file) = (self.0.join("machine"), self.0.join("b.tar.gz"));
        let (list, left_out) = save("pump", &machine, &machine.join(".takt"), &file).unwrap();
        assert!(left_out.is_empty() && list.files.len() == 5, "{list:?}");
        file
    }
    /// A backup with these members; a list of its own is put in front if `list` says so.
    fn forged(&self, members: &[(&str, tar::EntryType, &[u8])], list: Option<&str>) -> PathBuf {
        let file = self.0.join("forged.tar.gz");
        let mut archive = tar::Builder::new(GzEncoder::new(fs::File::create(&file).unwrap(), Compression::fast()));
        let list = list.map(|text| (LIST, tar::EntryType::Regular, text.as_bytes()));
        for (path, kind, bytes) in list.iter().chain(members) {
            let mut header = tar::Header::new_ustar();
            header.as_old_mut().name[..path.len()].copy_from_slice(path.as_bytes());
            header.set_size(bytes.len() as u64);
            header.set_entry_type(*kind);
            header.set_cksum();
            archive.append(&header, *bytes).unwrap();
        }
        archive.into_inner().unwrap().finish().unwrap();
        file
    }
    #[track_caller]
    fn refused(&self, file: &Path, part: &str) {
        let to = self.0.join("restored");
        let error = restore(file, &to, false).expect_err("is refused").to_string();
        assert!(error.contains(part), "{error}");
        assert!(!to.exists() && !self.0.join("escaped").exists(), "nothing is written");
        assert!(
            fs::read_dir(&self.0).unwrap().all(|entry| !entry.unwrap().file_name().to_string_lossy().contains("restore-")),
            "nothing is left"
        );
    }
}
impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn list(members: &[(&str, &[u8])]) -> String {
    let member = |(path, bytes): &(&str, &[u8])| {
        let mut hash = Sha256::new();
        hash.update(bytes);
        Member { path: (*path).into(), size: bytes.len() as u64, sha256: hexadecimal(hash) }
    };
    let files = members.iter().map(member).collect();
    let list = List { format: FORMAT.into(), version: VERSION, takt: "x".into(), project: "p".into(), time: "t".into(), files };
    serde_json::to_string(&list).unwrap()
}

#[test]
fn what_was_saved_comes_back() {
    let folder = Folder::new("round");
    let file = folder.save();
    let to = folder.0.join("new/place");
    fs::create_dir_all(to.parent().unwrap()).unwrap();
    assert_eq!(restore(&file, &to, false).unwrap().project, "pump");
    for (name, text) in [("takt.toml", "[project]\n"), ("src/deep/点.st", "x"), ("nc/part.nc", "G0 X1"), (".takt/retain.0", "state")] {
        assert_eq!(fs::read_to_string(to.join(name)).unwrap(), text);
    }
    assert!(!to.join(".takt/lock").exists() && !to.join(".git").exists() && !to.join("target").exists());
}

#[test]
fn nothing_is_written_over_without_being_asked() {
    let folder = Folder::new("over");
    let file = folder.save();
    let to = folder.0.join("to");
    fs::create_dir_all(&to).unwrap();
    fs::write(to.join("takt.toml"), "mine").unwrap();
    fs::write(to.join("other"), "mine").unwrap();
    assert!(restore(&file, &to, false).unwrap_err().to_string().contains("--force"));
    assert_eq!(fs::read_to_string(to.join("takt.toml")).unwrap(), "mine");
    let running = state::State::open(to.join(".takt")).unwrap();
    assert!(restore(&file, &to, true).unwrap_err().to_string().contains("under way"));
    drop(running);
    restore(&file, &to, true).unwrap();
    assert_eq!(fs::read_to_string(to.join("takt.toml")).unwrap(), "[project]\n");
    assert_eq!(fs::read_to_string(to.join("other")).unwrap(), "mine");
}

#[cfg(unix)]
#[test]
fn a_link_in_the_way_is_not_followed() {
    let folder = Folder::new("link");
    let file = folder.save();
    let (to, outside) = (folder.0.join("to"), folder.0.join("outside"));
    fs::create_dir_all(&to).unwrap();
    fs::create_dir_all(&outside).unwrap();
    std::os::unix::fs::symlink(&outside, to.join("src")).unwrap();
    assert!(restore(&file, &to, true).unwrap_err().to_string().contains("link"));
    assert!(fs::read_dir(&outside).unwrap().next().is_none() && !to.join("takt.toml").exists());
}

#[test]
fn damage_at_any_byte_is_found() {
    let folder = Folder::new("damage");
    let whole = fs::read(folder.save()).unwrap();
    let file = folder.0.join("damaged.tar.gz");
    for cut in (0..whole.len()).step_by(7) {
        fs::write(&file, &whole[..cut]).unwrap();
        folder.refused(&file, "damaged.tar.gz");
    }
    // Behind the 10 bytes of the head, of which time and system mean nothing.
    for at in (10..whole.len()).step_by(3) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        fs::write(&file, bytes).unwrap();
        let to = folder.0.join("restored");
        if restore(&file, &to, false).is_ok() {
            // Only the checksum of the whole stream, or bits of it that mean nothing, were hit.
            assert_eq!(fs::read_to_string(to.join("nc/part.nc")).unwrap(), "G0 X1", "{at}");
            assert_eq!(fs::read_to_string(to.join("src/main.st")).unwrap(), "PROGRAM p END_PROGRAM", "{at}");
            fs::remove_dir_all(&to).unwrap();
        }
        assert!(!to.exists(), "{at}");
    }
}

#[test]
fn hostile_backups_are_refused_by_name() {
    let folder = Folder::new("hostile");
    let plain = tar::EntryType::Regular;
    let x: &[u8] = b"x";
    for path in
        ["../escaped", "/escaped", "project/../../escaped", "project", "escaped", "project//a", "project/./a", "state/a\\b", "project/a:b"]
    {
        folder.refused(&folder.forged(&[(path, plain, x)], Some(&list(&[(path, x)]))), "leads outside");
    }
    folder.refused(&folder.forged(&[("project/a", plain, x)], None), "expected takt-backup.json");
    folder.refused(&folder.forged(&[], None), "");
    folder.refused(&folder.forged(&[("project/a", plain, b"y")], Some(&list(&[("project/a", x)]))), "damaged");
    folder.refused(&folder.forged(&[("project/a", plain, b"xy")], Some(&list(&[("project/a", x)]))), "with 2 bytes");
    folder.refused(&folder.forged(&[], Some(&list(&[("project/a", x)]))), "cut");
    folder.refused(&folder.forged(&[("project/a", plain, x)], Some(&list(&[]))), "not in its list");
    folder.refused(&folder.forged(&[], Some(&list(&[("project/a", x), ("project/A", x)]))), "twice");
    for kind in [
        tar::EntryType::Symlink,
        tar::EntryType::Link,
        tar::EntryType::Directory,
        tar::EntryType::GNULongName,
        tar::EntryType::XHeader,
        tar::EntryType::Char,
    ] {
        folder.refused(&folder.forged(&[("project/a", kind, x)], Some(&list(&[("project/a", x)]))), "no plain file");
    }
    folder.refused(&folder.forged(&[], Some("{\"format\":\"takt-backup\",\"version\":2}")), "of version 1");
    folder.refused(&folder.forged(&[], Some(&"[".repeat(100_000))), "its list");
    let large = list(&[("project/a", x)]).replace("\"size\":1", "\"size\":999999999999999");
    folder.refused(&folder.forged(&[], Some(&large)), "are the most");
    // A bomb: a gigabyte of zeros behind a list that does not name it.
    let file = folder.0.join("bomb.tar.gz");
    let mut out = GzEncoder::new(fs::File::create(&file).unwrap(), Compression::fast());
    let zeros = vec![0; 1 << 20];
    (0..64).for_each(|_| out.write_all(&zeros).unwrap());
    out.finish().unwrap();
    folder.refused(&file, "no backup");
}
