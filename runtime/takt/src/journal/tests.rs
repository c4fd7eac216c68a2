use super::read::last;
use super::*;
use takt_abi::Time;

struct Folder(std::path::PathBuf);
impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("takt-journal-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
    fn texts(&self, count: Option<usize>) -> Vec<String> {
        let show = |line: read::Line| line.map_or_else(|problem| format!("! {problem}"), |entry| entry.message.unwrap_or_default());
        last(&self.0, count).unwrap().0.into_iter().map(show).collect()
    }
}
impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn warning(text: impl Into<String>) -> Entry {
    Entry::new(Event::Warning).message(text).timed(SystemTime::UNIX_EPOCH)
}

#[test]
fn what_is_posted_is_written_in_order_with_its_time() {
    let folder = Folder::new("order");
    let (journal, mut scans) = Journal::open(&folder.0, vec!["Fast".into()]).unwrap();
    journal.post(Entry::new(Event::Force).by("anna", "uid 1000", "test").variable("G.x").values(Some("0".into()), Some("5".into())));
    scans.post(Notice::Overrun { task: 0, count: 3, time: Time(17) });
    drop(journal);
    let (lines, _) = last(&folder.0, None).unwrap();
    let [force, overrun] = &lines[..] else { panic!("{lines:?}") };
    let force = force.as_ref().unwrap();
    assert!(force.time.starts_with("20") && force.time.ends_with('Z'), "{}", force.time);
    let text = read::for_people(force);
    assert!(text.ends_with("  force    G.x 0 → 5 by anna (uid 1000) “test”"), "{text}");
    let overrun = overrun.as_ref().unwrap();
    assert_eq!((overrun.variable.as_deref(), overrun.time_ns), (Some("Fast"), Some(17)));
}

#[test]
fn files_rotate_and_the_last_lines_reach_over_them() {
    let folder = Folder::new("rotate");
    let mut file = JournalFile::open_with(&folder.0, 400).unwrap();
    (0..200).for_each(|i| file.append(&warning(format!("line {i}"))).unwrap());
    assert!(generation(&folder.0, file::KEPT).exists() && !generation(&folder.0, file::KEPT + 1).exists());
    let all = folder.texts(None);
    assert!(all.len() > 30 && all.len() < 50, "{}", all.len());
    assert_eq!(all.last().map(String::as_str), Some("line 199"));
    assert_eq!(folder.texts(Some(10)), (190..200).map(|i| format!("line {i}")).collect::<Vec<_>>());
    for number in 0..=file::KEPT {
        assert!(std::fs::metadata(generation(&folder.0, number)).unwrap().len() <= 400);
    }
}

#[test]
fn a_follower_sees_every_line_once_through_rotations() {
    let folder = Folder::new("follow");
    let mut file = JournalFile::open_with(&folder.0, 400).unwrap();
    file.append(&warning("line 0")).unwrap();
    let (_, mut follower) = last(&folder.0, None).unwrap();
    let mut seen = Vec::new();
    for i in 1..100 {
        file.append(&warning(format!("line {i}"))).unwrap();
        if i % 3 == 0 {
            seen.extend(follower.more().unwrap().into_iter().map(|line| line.unwrap().message.unwrap()));
        }
    }
    assert_eq!(seen, (1..100).map(|i| format!("line {i}")).collect::<Vec<_>>());
}

#[test]
fn a_torn_line_costs_no_other_line() {
    let folder = Folder::new("torn");
    JournalFile::open(&folder.0).unwrap().append(&warning("before")).unwrap();
    let path = generation(&folder.0, 0);
    let whole = std::fs::read(&path).unwrap();
    for cut in 1..whole.len() {
        std::fs::write(&path, [&whole[..], &whole[..cut]].concat()).unwrap();
        JournalFile::open(&folder.0).unwrap().append(&warning("after")).unwrap();
        let texts = folder.texts(None);
        assert_eq!((texts.first().map(String::as_str), texts.last().map(String::as_str)), (Some("before"), Some("after")), "{cut}");
        assert_eq!(texts.len(), 3, "{cut}");
    }
}

#[test]
fn hostile_files_are_told_of_and_never_shown_raw() {
    let folder = Folder::new("hostile");
    let line = r#"{"event":"write","who":"\u001b[2Jroot","variable":"a\u202eb","later":1}"#;
    let mut bytes = format!("{line}\n\u{0}\nnull\n{}\n", "[".repeat(100_000)).into_bytes();
    bytes.extend_from_slice(&[0xFF, 0xFE, b'\n']);
    bytes.extend(std::iter::repeat_n(b'x', 1 << 20));
    bytes.extend_from_slice(b"\n{\"event\":\"new-in-version-9\"}\n");
    std::fs::write(generation(&folder.0, 0), bytes).unwrap();
    let (lines, _) = last(&folder.0, None).unwrap();
    let text = read::for_people(lines[0].as_ref().unwrap());
    assert!(!text.contains('\u{1b}') && !text.contains('\u{202e}') && text.contains("[2Jroot"), "{text}");
    assert!(lines[1..6].iter().all(Result::is_err), "{lines:?}");
    assert_eq!(lines[6].as_ref().unwrap().event, Event::Unknown);
}

#[test]
fn what_does_not_fit_is_counted_and_the_count_is_written() {
    let folder = Folder::new("lost");
    let (journal, mut scans) = Journal::open(&folder.0, Vec::new()).unwrap();
    (0..QUEUE + 500).for_each(|i| scans.post(Notice::IoGood { time: Time(i as i64) }));
    drop(journal);
    let (lines, _) = last(&folder.0, None).unwrap();
    let good = lines.iter().filter(|line| line.as_ref().is_ok_and(|entry| entry.event == Event::IoGood)).count();
    assert!(good >= QUEUE, "{good}");
    assert!(good == QUEUE + 500 || lines.iter().any(|line| line.as_ref().is_ok_and(|entry| entry.event == Event::Lost)), "{good}");
}
