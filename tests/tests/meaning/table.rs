//! The table of meanings as it lies in `tests/data/meaning`; `tests/oracle/table.py` writes it and says how it reads.

use std::collections::HashMap;

/// What must come of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cell {
    /// These bits in the target.
    Bits(u64),
    /// A division by zero.
    Fault,
    /// The table does not say.
    Open,
}

/// Operands of one type.
#[derive(Debug)]
pub struct List {
    /// The type's name.
    pub ty: String,
    /// Their bits.
    pub bits: Vec<u64>,
}

/// An expression over lists of operands; the last list runs fastest.
#[derive(Debug, Clone)]
pub struct Line {
    /// Type that the expression is assigned to.
    pub target: String,
    /// With `{a}`, `{b}`, `{c}`.
    pub template: String,
    /// One per row.
    pub cells: Vec<Cell>,
}

/// Lines over the same operands.
#[derive(Debug)]
pub struct Unit<'a> {
    /// Whether integers are cut at each operator.
    pub iec: bool,
    /// Names of the lists.
    pub operands: Vec<&'a str>,
    /// What is computed of them.
    pub lines: Vec<&'a Line>,
}

/// All of it.
#[derive(Debug)]
pub struct Table {
    /// By name, `INT.small`.
    pub lists: HashMap<String, List>,
    /// Source, target and what is said of the assignment: `.`, `w` or `e`.
    pub implicit: Vec<(String, String, char)>,
    lines: Vec<(bool, Vec<Vec<String>>, Line)>,
}

impl Table {
    /// Reads the file's text.
    pub fn read(text: &str) -> Self {
        let mut table = Self { lists: HashMap::new(), implicit: Vec::new(), lines: Vec::new() };
        for line in text.lines().filter(|l| !l.starts_with('#')) {
            match (line.strip_prefix("values "), line.strip_prefix("implicit ")) {
                (Some(list), _) => table.list(list),
                (_, Some(verdicts)) => table.verdicts(verdicts),
                _ => table.line(line),
            }
        }
        table
    }

    fn list(&mut self, text: &str) {
        let mut words = text.split(' ');
        let (ty, name) = (words.next().expect("a type"), words.next().expect("a list"));
        let bits = words.map(|w| u64::from_str_radix(w, 16).expect("bits")).collect();
        self.lists.insert(format!("{ty}.{name}"), List { ty: ty.into(), bits });
    }

    fn verdicts(&mut self, text: &str) {
        let (source, targets) = text.split_once(' ').expect("a source");
        for target in targets.split(' ') {
            let (target, verdict) = target.split_at(target.len() - 1);
            self.implicit.push((source.into(), target.into(), verdict.chars().next().expect("a verdict")));
        }
    }

    fn line(&mut self, text: &str) {
        let [head, groups, template, cells] = text.split(" | ").collect::<Vec<_>>().try_into().expect("four parts");
        let (arithmetic, target) = head.split_once(' ').expect("an arithmetic and a target");
        let cells = if target == "BOOL" {
            cells.split("").filter(|c| !c.is_empty()).map(cell).collect()
        } else {
            cells.split(' ').map(cell).collect()
        };
        let groups: Vec<Vec<String>> = groups.split(' ').map(|g| g.split(',').map(String::from).collect()).collect();
        let line = Line { target: target.into(), template: template.into(), cells };
        for iec in [false, true] {
            if arithmetic == "both" || (arithmetic == "iec") == iec {
                self.lines.push((iec, groups.clone(), line.clone()));
            }
        }
    }

    /// The lines by operands, in the order of the file.
    pub fn units(&self) -> Vec<Unit<'_>> {
        let mut units: Vec<Unit<'_>> = Vec::new();
        let mut known: HashMap<(bool, Vec<&str>), usize> = HashMap::new();
        for (iec, groups, line) in &self.lines {
            for group in groups {
                let operands: Vec<&str> = group.iter().map(String::as_str).collect();
                let at = *known.entry((*iec, operands.clone())).or_insert(units.len());
                if at == units.len() {
                    units.push(Unit { iec: *iec, operands, lines: Vec::new() });
                }
                units[at].lines.push(line);
            }
        }
        units
    }

    /// Indices into the lists of operands of a row.
    pub fn indices(&self, unit: &Unit<'_>, row: usize) -> Vec<usize> {
        let mut rest = row;
        let mut indices: Vec<usize> = unit
            .operands
            .iter()
            .rev()
            .map(|name| {
                let count = self.lists[*name].bits.len();
                let index = rest % count;
                rest /= count;
                index
            })
            .collect();
        indices.reverse();
        indices
    }
}

fn cell(text: &str) -> Cell {
    match text {
        "!" => Cell::Fault,
        "?" => Cell::Open,
        bits => Cell::Bits(u64::from_str_radix(bits, 16).expect("bits")),
    }
}

/// The expression of a template with these operands.
pub fn filled(template: &str, operands: &[String]) -> String {
    ["{a}", "{b}", "{c}"].iter().zip(operands).fold(template.into(), |text, (mark, operand)| text.replace(mark, operand))
}
