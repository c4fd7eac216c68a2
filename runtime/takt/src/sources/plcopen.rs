//! PLCopen XML (TC6, 2.0 and 2.01), with the additional data of CODESYS.
//!
//! Units, types and lists are found wherever they stand: in `<types>`, in a resource, or in `<addData>`. Where CODESYS gives a declaration as plain
//! text, that is taken; else it is written from the elements.

mod declare;
mod initial;
mod types;
mod units;

use super::layout::Writer;
use super::tasks::{self, Plan, ident};
use super::xml::Element;
use takt_syntax::Code;

/// Additional data whose absence changes nothing.
const HARMLESS: &[&str] = &["objectid", "projectstructure", "projectinformation", "folders", "buildproperties"];
/// Additional data in which units, types and lists stand.
const KNOWN: &[&str] = &["application", "pou", "datatype", "union", "globalvars", "interface", "libraries"];

/// Writes what a file holds. `stem` is its name without folder and extension.
pub(super) fn write(root: &Element<'_>, stem: &str, writer: &mut Writer) {
    if root.name != "project" {
        let message = format!("expected <project> of PLCopen XML, found <{}>", root.name);
        let help = "in CODESYS choose Project, Export PLCopenXML…; other forms of export are not read";
        return writer.refuse(Code::BadFile, root.open.clone(), message, help);
    }
    let mut project = Project { stem, writer, plans: Vec::new(), configuration: None };
    project.objects(root);
    let name = project.configuration.map_or_else(|| "Tasks".to_string(), |name| ident(&name));
    tasks::write(&name, &project.plans, project.writer);
}

/// The content of additional data of CODESYS: `interfaceasplaintext`, `method`, …
pub(super) fn data<'a, 'x>(element: &'a Element<'x>, name: &str) -> Option<&'a Element<'x>> {
    all_data(element).find(|(known, _)| *known == name).map(|(_, data)| data)
}

/// All additional data and their names, without what names the maker.
fn all_data<'a, 'x>(element: &'a Element<'x>) -> impl Iterator<Item = (&'a str, &'a Element<'x>)> {
    let lists = element.children().filter(|child| child.name == "addData");
    lists.flat_map(Element::children).filter(|child| child.name == "data").map(|data| (short_name(data), data))
}

fn short_name<'a>(data: &'a Element<'_>) -> &'a str {
    let name = data.value("name").unwrap_or_default();
    name.rsplit_once('/').map_or(name, |(_, short)| short)
}

struct Project<'w, 's> {
    stem: &'s str,
    writer: &'w mut Writer,
    plans: Vec<Plan>,
    configuration: Option<String>,
}

impl Project<'_, '_> {
    /// Everything inside of an element, in the order of the file.
    fn objects(&mut self, element: &Element<'_>) {
        for child in element.children() {
            let name = child.value("name");
            match (child.name, name) {
                ("pou", Some(name)) => units::unit(child, name, self.writer),
                ("dataType", Some(name)) => types::data_type(child, name, self.writer),
                ("union", Some(name)) => types::union(child, name, self.writer),
                ("Interface" | "interface", Some(name)) => units::interface(child, name, self.writer),
                ("globalVars", name) => self.globals(child, name.unwrap_or(self.stem)),
                ("task", Some(_)) => self.plans.push(tasks::of_plcopen(child, self.writer)),
                ("pouInstance", Some(name)) => {
                    let message = format!("the program instance `{name}` belongs to no task");
                    self.writer.refuse(Code::BadFile, child.open.clone(), message, "let a task call it and export the project again");
                }
                ("configuration" | "resource", name) => {
                    if self.configuration.is_none() {
                        self.configuration = name.map(str::to_string);
                    }
                    self.objects(child);
                }
                ("data", _) => self.data(child),
                ("Library", _) => self.library(child),
                ("fileHeader" | "contentHeader" | "documentation", _) => {}
                _ => self.objects(child),
            }
        }
    }

    fn data(&mut self, data: &Element<'_>) {
        let name = short_name(data);
        if KNOWN.contains(&name) {
            self.objects(data);
        } else if !HARMLESS.contains(&name) {
            self.writer.left(&data.open, &format!("additional data `{name}`"), "it has no counterpart in ST");
        }
    }

    fn library(&mut self, library: &Element<'_>) {
        let name = library.value("Name").unwrap_or("?");
        let reason = "libraries are not carried over; Takt's own blocks are used where they have the same names";
        self.writer.left(&library.open, &format!("the library {name}"), reason);
    }

    /// A list of global variables. The compiler calls it as the file is called, or as an attribute says.
    fn globals(&mut self, list: &Element<'_>, name: &str) {
        self.writer.unit(name);
        let attribute = self.writer.needs_name(name, self.stem).then_some(name);
        if let Some(text) = data(list, "interfaceasplaintext") {
            let pieces = text.pieces();
            return match attribute {
                Some(name) => super::twincat::named_globals(&pieces, name, self.writer),
                None => self.writer.copy_lines(&pieces),
            };
        }
        // Where sections differ in CONSTANT or RETAIN the list itself has all variables, and only this one knows which is which.
        let mixed = data(list, "mixedattrsvarlist").and_then(|data| data.child("MixedAttrsVarList"));
        let sections: Vec<&Element<'_>> = mixed.map_or_else(|| vec![list], |mixed| mixed.children().collect());
        for section in sections {
            declare::attributes(list, self.writer);
            if let Some(name) = attribute {
                self.writer.put_line(&format!("{{attribute 'gvl_name' := '{name}'}}"), section.open.clone());
            }
            declare::section("VAR_GLOBAL", section, self.writer);
        }
    }
}

#[cfg(test)]
mod tests;
