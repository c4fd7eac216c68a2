//! TwinCAT's project file `.plcproj`: which files are compiled, and what else the project names.

use super::layout::Writer;
use super::xml::Element;
use std::ops::Range;
use std::path::{Path, PathBuf};
use takt_syntax::Code;

/// A file that a project names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Item {
    /// From the folder of the project.
    pub path: PathBuf,
    /// Where its name stands.
    pub at: Range<usize>,
}

/// The files to be compiled, in the order of the project. What is not among them is told to the writer.
pub(super) fn items(root: &Element<'_>, writer: &mut Writer) -> Vec<Item> {
    if root.name != "Project" {
        let message = format!("expected <Project>, found <{}>", root.name);
        writer.refuse(Code::BadFile, root.open.clone(), message, "name the .plcproj of the PLC, not that of the solution");
        return Vec::new();
    }
    let groups = || root.children().filter(|child| child.name == "ItemGroup").flat_map(Element::children);
    let closed: Vec<(String, bool)> = groups()
        .filter(|item| item.name == "Folder")
        .filter_map(|folder| Some((plain(folder.value("Include")?).to_lowercase(), excluded(folder)?)))
        .collect();
    let mut items = Vec::new();
    for item in groups() {
        let Some(include) = item.attribute("Include") else { continue };
        let path = plain(&include.value);
        match item.name {
            "Compile" if excluded(item).unwrap_or_else(|| in_closed_folder(&path, &closed)) => {
                writer.left(&include.at, &path, "it is excluded from the build");
            }
            "Compile" => items.push(Item { path: path.into(), at: include.at.clone() }),
            "PlaceholderReference" | "LibraryReference" => {
                let reason = "libraries are not carried over; Takt's own blocks are used where they have the same names";
                writer.left(&include.at, &format!("the library {}", include.value), reason);
            }
            "None" | "Content" => writer.left(&include.at, &path, "it holds no program"),
            _ => {}
        }
    }
    items
}

/// The names of the project as a library, with which others write the names of its units.
pub(super) fn names(root: &Element<'_>) -> Vec<String> {
    let groups = root.children().filter(|child| child.name == "PropertyGroup").flat_map(Element::children);
    let named = groups.filter(|property| matches!(property.name, "Name" | "Title" | "DefaultNamespace"));
    let mut names: Vec<String> = named.map(|property| property.text().trim().to_string()).filter(|name| !name.is_empty()).collect();
    names.sort();
    names.dedup();
    names
}

/// What an item says of being left out; `None` if it says nothing.
fn excluded(item: &Element<'_>) -> Option<bool> {
    item.child("ExcludeFromBuild").map(|flag| flag.text().eq_ignore_ascii_case("true"))
}

/// What the innermost folder that says something says.
fn in_closed_folder(path: &str, folders: &[(String, bool)]) -> bool {
    let path = path.to_lowercase();
    let around = folders.iter().filter(|(folder, _)| path.strip_prefix(folder.as_str()).is_some_and(|rest| rest.starts_with('/')));
    around.max_by_key(|(folder, _)| folder.len()).is_some_and(|(_, closed)| *closed)
}

/// A path as this system writes it: `POUs\FB%20A.TcPOU` is `POUs/FB A.TcPOU`.
fn plain(include: &str) -> String {
    let mut bytes = Vec::with_capacity(include.len());
    let mut rest = include.as_bytes();
    while let Some((&first, behind)) = rest.split_first() {
        let hex = |digits: &[u8]| std::str::from_utf8(digits).ok().and_then(|digits| u8::from_str_radix(digits, 16).ok());
        match (first, behind.get(..2).and_then(hex)) {
            (b'%', Some(byte)) => {
                bytes.push(byte);
                rest = &behind[2..];
            }
            (b'\\', _) => {
                bytes.push(b'/');
                rest = behind;
            }
            _ => {
                bytes.push(first);
                rest = behind;
            }
        }
    }
    String::from_utf8_lossy(&bytes).trim_end_matches('/').to_string()
}

/// The file that an item names; names match in any case, as on Windows.
pub(super) fn resolve(folder: &Path, path: &Path) -> Option<PathBuf> {
    let mut found = folder.to_path_buf();
    for part in path.components() {
        let next = found.join(part);
        found = match part {
            std::path::Component::Normal(name) if !next.exists() => {
                let name = name.to_string_lossy().to_lowercase();
                let entries = std::fs::read_dir(if found.as_os_str().is_empty() { Path::new(".") } else { &found }).ok()?;
                let same = entries.flatten().find(|entry| entry.file_name().to_string_lossy().to_lowercase() == name)?;
                found.join(same.file_name())
            }
            _ => next,
        };
    }
    found.is_file().then_some(found)
}

#[cfg(test)]
mod tests {
    use super::super::layout::Style;
    use super::*;
    use takt_syntax::Source;

    #[test]
    fn files_folders_and_exclusions_are_understood() {
        let text = r#"<Project><PropertyGroup><Name>Lib</Name><Title>Lib</Title><DefaultNamespace>L</DefaultNamespace></PropertyGroup><ItemGroup>
            <Compile Include="POUs\MAIN.TcPOU"><SubType>Code</SubType></Compile>
            <Compile Include="POUs\Old\FB%20A.TcPOU"><SubType>Code</SubType></Compile>
            <Compile Include="POUs\Old\Kept.TcPOU"><ExcludeFromBuild>false</ExcludeFromBuild></Compile>
            <Compile Include="Off.TcPOU"><ExcludeFromBuild>true</ExcludeFromBuild></Compile>
            <None Include="Visu.TcVMO"/></ItemGroup>
            <ItemGroup><Folder Include="POUs\Old"><ExcludeFromBuild>true</ExcludeFromBuild></Folder>
            <PlaceholderReference Include="Tc2_MC2"/></ItemGroup></Project>"#;
        let mut writer = Writer::new(Style::Places, Source { name: "a.plcproj".into(), text: text.into() });
        let root = super::super::xml::parse(text).unwrap();
        assert_eq!(names(&root), ["L", "Lib"]);
        let items = items(&root, &mut writer);
        let paths: Vec<_> = items.iter().map(|item| item.path.to_string_lossy().into_owned()).collect();
        assert_eq!(paths, ["POUs/MAIN.TcPOU", "POUs/Old/Kept.TcPOU"]);
        assert_eq!(&text[items[0].at.clone()], r"POUs\MAIN.TcPOU");
        let left: Vec<_> = writer.finish("a").left.into_iter().map(|left| (left.what, left.line)).collect();
        let expected = [("POUs/Old/FB A.TcPOU", 3), ("Off.TcPOU", 5), ("Visu.TcVMO", 6), ("the library Tc2_MC2", 8)];
        assert_eq!(left, expected.map(|(what, line)| (what.to_string(), line)));
    }
}
