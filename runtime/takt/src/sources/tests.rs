use super::*;

/// A folder of its own with these files.
fn folder(name: &str, files: &[(&str, &[u8])]) -> PathBuf {
    let root = std::env::temp_dir().join(format!("takt-sources-{name}-{}", std::process::id()));
    for (file, bytes) in files {
        let path = root.join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    root
}

fn names(root: &Path, sources: &Sources) -> Vec<String> {
    sources.list.iter().map(|source| source.name.trim_start_matches(root.to_str().unwrap()).replace('\\', "/")).collect()
}

/// `file:line:column message` of every finding, in the files that people edit.
fn findings(root: &Path, sources: &Sources) -> Vec<String> {
    let said = sources.findings.iter().map(|finding| {
        let origin = &sources.origins[&(finding.span.file.0 as usize)];
        let (file, range) = origin.place(finding.span.start as usize..finding.span.end as usize);
        let place = crate::manifest::Place::of(&file.text, range.start);
        let name = file.name.trim_start_matches(root.to_str().unwrap());
        format!("{name}:{}:{} {} {}", place.line, place.column, finding.code.text(), finding.message)
    });
    said.collect()
}

/// The object of a TwinCAT file.
fn tc(object: &str) -> String {
    format!("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<TcPlcObject>\n{object}\n</TcPlcObject>")
}

#[test]
fn folders_are_walked_in_sorted_order() {
    let files: [(&str, &[u8]); 8] = [
        ("z.st", b"x"),
        ("a.ST", b"x"),
        ("b/m.iecst", b"x"),
        ("b/readme.txt", b"x"),
        (".hidden.st", b"x"),
        ("b/d.TcDUT", b"<TcPlcObject/>"),
        ("b/e.xml", b"<settings/>"),
        ("b/f.xml", b"<project xmlns='http://www.plcopen.org/xml/tc6_0201'/>"),
    ];
    let root = folder("walk", &files);
    let sources = read(std::slice::from_ref(&root)).unwrap();
    assert_eq!(names(&root, &sources), ["/a.ST", "/b/d.TcDUT", "/b/f.xml", "/b/m.iecst", "/z.st"]);
    assert!(matches!(read(&[root.join("none")]), Err(SourceError::Missing(_))));
    assert!(matches!(read(&[root.join("b/readme.txt")]), Err(SourceError::NotSource(_))));
    let twice = read(&[root.join("z.st"), root.clone(), root.join("b/../z.st")]).unwrap();
    assert_eq!(twice.list.len(), 5, "a file is read once");
    std::fs::remove_dir_all(root).unwrap();
}

#[cfg(unix)]
#[test]
fn links_that_lead_back_are_walked_once() {
    let root = folder("links", &[("a/x.st", b"x")]);
    for link in ["b", "c", "a/d", "a/e"] {
        std::os::unix::fs::symlink(&root, root.join(link)).unwrap();
    }
    assert_eq!(read(std::slice::from_ref(&root)).unwrap().list.len(), 1);
    std::fs::remove_dir_all(root).unwrap();
}

#[test]
fn archives_and_giants_are_refused() {
    let root = folder(
        "packed",
        &[("a.project", b"x"), ("b.tnzip", b"x"), ("c.st", b"PK\x03\x04rest"), ("d.TcPOU", b"\x1F\x8B\x08"), ("e/f.txt", b"")],
    );
    let said = |file: &str| read(&[root.join(file)]).unwrap_err().to_string();
    assert!(said("a.project").contains("Export PLCopenXML"));
    assert!(said("b.tnzip").contains("ZIP archive"));
    assert!(said("c.st").contains("unpack it") && said("d.TcPOU").contains("unpack it"));
    assert!(said("e").contains("holds no source file"));
    std::fs::write(root.join("e/g.projectarchive"), "x").unwrap();
    assert!(said("e").contains("Export PLCopenXML"));
    std::fs::File::create(root.join("big.st")).unwrap().set_len(100 << 20).unwrap();
    assert!(said("big.st").contains("larger than 64 MiB"));
    std::fs::remove_dir_all(root).unwrap();
}

#[test]
fn damaged_files_are_said_with_their_place_and_spare_the_rest() {
    let cut = tc("  <POU Name=\"a\">\n    <Declaration><![CDATA[PROGRAM a");
    let files: [(&str, &[u8]); 5] = [
        ("a.TcPOU", cut.as_bytes()),
        ("b.st", "// 点胶阀打开\nx\u{1}".as_bytes()),
        ("c.st", b"PROGRAM c END_PROGRAM"),
        ("d.TcGVL", b"<Other/>"),
        ("e.xml", b"<ExportFile xmlns='plcopen.org/xml/tc6'/>"),
    ];
    let root = folder("damaged", &files);
    let sources = read(std::slice::from_ref(&root)).unwrap();
    assert_eq!(sources.list.len(), 5);
    let said = findings(&root, &sources);
    assert!(said[0].starts_with("/a.TcPOU:4:18 E0501 this is not well-formed XML"), "{said:?}");
    let rest = [
        "/b.st:2:2 E0501 expected text, found the control character 0x01",
        "/d.TcGVL:1:1 E0501 expected <TcPlcObject>, found <Other>",
        "/e.xml:1:1 E0501 expected <project> of PLCopen XML, found <ExportFile>",
    ];
    assert_eq!(said[1..], rest);
    std::fs::remove_dir_all(root).unwrap();
}

#[test]
fn a_project_names_its_files_in_any_case_and_misses_none() {
    let project = b"<Project><ItemGroup><Compile Include=\"sub\\x.TcDUT\"/>\n<Compile Include=\"gone.TcPOU\"/>\n<Compile Include=\"p.plcproj\"/></ItemGroup></Project>";
    let dut = tc("<DUT Name=\"X\"><Declaration>TYPE X : INT; END_TYPE</Declaration></DUT>");
    let root = folder("project", &[("p.plcproj", project), ("Sub/X.TcDUT", dut.as_bytes()), ("other.st", b"x")]);
    let sources = read(std::slice::from_ref(&root)).unwrap();
    assert_eq!(names(&root, &sources), ["/p.plcproj", "/Sub/X.TcDUT"]);
    assert_eq!(findings(&root, &sources), ["/p.plcproj:2:19 E0501 `gone.TcPOU` is part of the project, but there is no such file"]);
    std::fs::write(root.join("Sub/q.plcproj"), project).unwrap();
    assert!(matches!(read(std::slice::from_ref(&root)), Err(SourceError::TwoProjects(..))));
    std::fs::remove_dir_all(root).unwrap();
}

#[test]
fn every_encoding_is_told_and_keeps_its_columns() {
    let gvl = |comment: &[u8]| [b"VAR_GLOBAL\n// ", comment, b"\nx : INT; END_VAR"].concat();
    let wide: Vec<u8> = "\u{FEFF}VAR_GLOBAL // 点\nEND_VAR".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let dut = [
        b"<?xml version=\"1.0\" encoding=\"gb2312\"?><TcPlcObject><DUT><Declaration>// ".as_slice(),
        b"\xB5\xE3\xBD\xBA",
        b"\nTYPE T : INT; END_TYPE</Declaration></DUT></TcPlcObject>",
    ]
    .concat();
    let files: [(&str, &[u8]); 4] =
        [("a.st", &gvl(b"\xB5\xE3\xBD\xBA\xB7\xA7")), ("b.st", &gvl(b"Gr\xF6\xDFe")), ("c.st", &wide), ("d.TcDUT", &dut)];
    let root = folder("encodings", &files);
    let sources = read(std::slice::from_ref(&root)).unwrap();
    let told: Vec<_> = sources.converted.iter().map(|(_, encoding)| encoding.name()).collect();
    assert_eq!(told, ["GBK", "Latin-1", "UTF-16 LE", "GBK"]);
    assert!(sources.list[0].text.contains("点胶阀") && sources.list[1].text.contains("Größe") && sources.list[3].text.contains("点胶"));
    std::fs::remove_dir_all(root).unwrap();
}

#[test]
fn lists_are_called_as_their_object_whatever_the_file_is_called() {
    let gvl = tc(
        "  <GVL Name=\"Io\">\n    <Declaration><![CDATA[// VAR_GLOBAL\n{attribute 'qualified_only'}\nVAR_GLOBAL\n  a : INT;\nEND_VAR\nVAR_GLOBAL CONSTANT\n  b : INT := 3;\nEND_VAR]]></Declaration>\n  </GVL>",
    );
    let root = folder(
        "named",
        &[("Copy of Io.TcGVL", gvl.as_bytes()), ("main.st", b"PROGRAM main VAR x : INT; END_VAR\nx := Io.a + Io.b;\nEND_PROGRAM")],
    );
    let project = crate::project::load(&root).unwrap();
    let compiled = crate::program::compile(&project, &[]);
    assert!(compiled.diagnostics.is_empty(), "{:?}", compiled.diagnostics);
    assert_eq!(project.sources.list[0].text.lines().nth(5).unwrap(), "{attribute 'gvl_name' := 'Io'} VAR_GLOBAL");
    let (_, export) = export(std::slice::from_ref(&root)).unwrap();
    assert!(export.units[0].1 == "Io" && !export.units[0].2.contains("gvl_name"), "{:?}", export.units[0]);
    std::fs::remove_dir_all(root).unwrap();
}

#[test]
fn the_tasks_of_several_files_are_one_configuration() {
    let task = |name: &str, cycle: &str, program: &str| {
        tc(&format!(
            "<Task Name=\"{name}\">\n<CycleTime>{cycle}</CycleTime>\n<Priority>3</Priority>\n<PouCall><Name>{program}</Name></PouCall></Task>"
        ))
    };
    let files = [("a.TcTTO", task("Fast 1", "250", "P")), ("b.TcTTO", task("Slow", "x", "Missing"))];
    let files: Vec<(&str, &[u8])> = files.iter().map(|(name, text)| (*name, text.as_bytes())).collect();
    let root = folder("tasks", &files);
    std::fs::write(root.join("p.st"), "PROGRAM P END_PROGRAM").unwrap();
    let sources = read(std::slice::from_ref(&root)).unwrap();
    assert_eq!(names(&root, &sources), ["/p.st", "/a.TcTTO"]);
    let text = sources.list[1].text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("TASK Fast_1(INTERVAL := LTIME#250us, PRIORITY := 3);"), "{text}");
    assert!(text.ends_with("TASK Slow(PRIORITY := 3); PROGRAM Missing WITH Slow : Missing; END_CONFIGURATION"), "{text}");
    assert_eq!(findings(&root, &sources), ["/b.TcTTO:4:12 E0501 expected a cycle time in microseconds, found `x`"]);
    std::fs::write(root.join("b.TcTTO"), task("Slow", "10000", "Missing")).unwrap();
    let project = crate::project::load(&root).unwrap();
    let compiled = crate::program::compile(&project, &[]);
    let spot = compiled.locate(compiled.diagnostics[0].span);
    assert!(spot.file.ends_with("b.TcTTO") && &spot.text[spot.range.clone()] == "Missing", "{spot:?}");
    std::fs::write(root.join("b.TcTTO"), task("Slow", "10000", "P")).unwrap();
    let compiled = crate::program::compile(&crate::project::load(&root).unwrap(), &[]);
    let program = compiled.program.expect("no mistakes");
    let sites = program.sites.iter().filter(|site| program.files[site.file as usize].ends_with("b.TcTTO"));
    assert_eq!(sites.map(|site| (site.line, site.column)).collect::<Vec<_>>(), [(3, 13)]);
    std::fs::remove_dir_all(root).unwrap();
}

/// What is made of a damaged file has places in it, and the parser takes it.
fn survives(name: &str, text: &str) {
    for style in [Style::Places, Style::Clean] {
        let source = Source { name: name.into(), text: text.into() };
        let written = match name.rsplit_once('.').unwrap().1 {
            "xml" => write_xml(style, source, "stem", |root, writer| plcopen::write(root, "stem", writer)),
            "TcTTO" => write_xml(style, source, "stem", |root, writer| {
                let plans: Vec<_> = tasks::of_twincat(root, 0, writer).into_iter().collect();
                tasks::write("Tasks", &plans, writer);
            }),
            "plcproj" => write_xml(style, source, "stem", |root, writer| drop(plcproj::items(root, writer))),
            _ => write_xml(style, source, "stem", |root, writer| twincat::write(root, "stem", writer)),
        };
        for segment in &written.origin.segments {
            assert!(text.get(segment.from..segment.to).is_some(), "{name}: {segment:?}");
        }
        for unit in &written.units {
            let (_, found) = takt_syntax::parse(FileId(0), &unit.text);
            let spans = found.iter().chain(&written.findings).map(|diagnostic| diagnostic.span);
            for span in spans.filter(|_| style == Style::Places) {
                let (_, range) = written.origin.place(span.start as usize..span.end as usize);
                assert!(range.start <= range.end && range.end <= text.len(), "{name}: {range:?}");
            }
        }
    }
}

#[test]
fn a_file_damaged_anywhere_does_no_harm() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/import");
    let files = ["codesys/Blinker.xml", "oop/Drive.xml", "oop/FB_Drive.TcPOU", "twincat/POUs/MAIN.TcPOU", "twincat/GVLs/GVL_Sorter.TcGVL"];
    let scraps = [
        "<",
        ">",
        "</",
        "/>",
        "\"",
        "'",
        "=",
        "&",
        "&lt;",
        "<![CDATA[",
        "]]>",
        "<!--",
        "点",
        "(*",
        "*)",
        "//",
        "\n",
        "END_VAR",
        "VAR_GLOBAL ",
        "{",
        "}",
    ];
    let mut state = 1_u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below.max(1)
    };
    for file in files.iter().chain(&["twincat/PlcTask.TcTTO", "twincat/Sorter.plcproj"]) {
        let (text, _) = decode(std::fs::read(root.join(file)).unwrap()).unwrap();
        for round in 0..150 {
            let mut damaged: Vec<char> = text.chars().collect();
            for _ in 0..=random(3) {
                let at = random(damaged.len());
                match round % 3 {
                    0 => damaged.truncate(at),
                    1 => drop(damaged.drain(at..(at + 1 + random(40)).min(damaged.len()))),
                    _ => drop(damaged.splice(at..at, scraps[random(scraps.len())].chars()).collect::<Vec<_>>()),
                }
            }
            survives(file, &damaged.into_iter().collect::<String>());
        }
    }
}
