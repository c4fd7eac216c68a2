//! Which names a stream of tokens declares, without a tree.

use crate::lexer::{Kind, Token};
use std::collections::{HashMap, HashSet};

/// Attributes with their values.
pub(super) type Attributes = Vec<(String, Option<String>)>;

/// Names compare without regard to case.
pub(super) fn key(name: &str) -> String {
    name.to_uppercase()
}

/// A declared variable.
#[derive(Debug, Clone, Default)]
pub(super) struct Variable {
    /// Type as written, upper case, words apart by one space.
    pub ty: String,
    /// Initial value as written.
    pub value: String,
    /// CONSTANT.
    pub constant: bool,
    /// `{attribute}` before it.
    pub attributes: Attributes,
}

/// A program unit, method, structure or other type.
#[derive(Debug, Clone, Default)]
pub(super) struct Scope {
    /// EXTENDS.
    pub base: Option<String>,
    /// `{attribute}` before it.
    pub attributes: Attributes,
    /// What is declared in it.
    pub variables: HashMap<String, Variable>,
}

/// All that is declared.
#[derive(Debug, Clone, Default)]
pub(super) struct Facts {
    /// Program units; methods as `UNIT.METHOD`.
    pub pous: HashMap<String, Scope>,
    /// Types.
    pub types: HashMap<String, Scope>,
    /// Global variables, as `NAME` and as `LIST.NAME`.
    pub globals: HashMap<String, Variable>,
    /// Tasks.
    pub tasks: HashSet<String>,
    /// Resources.
    pub resources: HashSet<String>,
}

impl Facts {
    pub(super) fn join(&mut self, other: Self) {
        self.pous.extend(other.pous);
        self.types.extend(other.types);
        self.globals.extend(other.globals);
        self.tasks.extend(other.tasks);
        self.resources.extend(other.resources);
    }
}

/// What a condition at one place sees: its file up to there, and all files.
pub(super) struct View<'a> {
    /// This file's.
    pub own: &'a Facts,
    /// The project's.
    pub all: &'a Facts,
    /// The program unit around the place.
    pub unit: Option<&'a str>,
    /// The method around the place, as `UNIT.METHOD`.
    pub method: Option<&'a str>,
}

impl<'a> View<'a> {
    pub(super) fn pou(&self, name: &str) -> Option<&'a Scope> {
        self.own.pous.get(name).or_else(|| self.all.pous.get(name))
    }

    pub(super) fn ty(&self, name: &str) -> Option<&'a Scope> {
        self.own.types.get(name).or_else(|| self.all.types.get(name))
    }

    fn global(&self, name: &str) -> Option<&'a Variable> {
        self.own.globals.get(name).or_else(|| self.all.globals.get(name))
    }

    /// A member of a unit or structure, or of what it extends.
    fn member(&self, scope: &str, name: &str) -> Option<&'a Variable> {
        let mut scope = self.pou(scope).or_else(|| self.ty(scope))?;
        // No chain of bases is that long, unless it is a circle.
        for _ in 0..100 {
            if let Some(variable) = scope.variables.get(name) {
                return Some(variable);
            }
            let base = scope.base.as_deref()?;
            scope = self.pou(base).or_else(|| self.ty(base))?;
        }
        None
    }

    /// `x`, `GVL.x`, `PLC_PRG.x`, `block.member`.
    pub(super) fn variable(&self, path: &str) -> Option<&'a Variable> {
        let mut parts = path.split('.');
        let first = parts.next()?;
        let local = self.method.and_then(|method| self.member(method, first));
        let local = local.or_else(|| self.unit.and_then(|unit| self.member(unit, first)));
        let mut found = match local.or_else(|| self.global(first)) {
            Some(variable) => variable,
            None => {
                let second = parts.next()?;
                self.global(&format!("{first}.{second}")).or_else(|| self.member(first, second))?
            }
        };
        for part in parts {
            found = self.member(&found.ty, part)?;
        }
        Some(found)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    Idle,
    UnitName,
    UnitHead,
    BaseName,
    MemberName,
    TypeName,
    Names,
    Type,
    Value,
    TaskName,
    ResourceName,
}

/// Collects declarations token by token.
pub(super) struct Scanner<'a> {
    text: &'a str,
    list: String,
    /// What was found so far.
    pub facts: Facts,
    /// The unit that the next token belongs to.
    pub unit: Option<String>,
    /// The method that the next token belongs to.
    pub method: Option<String>,
    /// Attributes before the next token.
    pub pending: Attributes,
    mode: Mode,
    is_global: bool,
    is_qualified: bool,
    is_constant: bool,
    in_configuration: bool,
    behind: Kind,
    /// Structures that are open; an unnamed one is empty.
    structures: Vec<String>,
    type_name: String,
    head: Attributes,
    names: Vec<(String, Attributes)>,
    ty: String,
    value: String,
}

impl<'a> Scanner<'a> {
    /// Of a text whose global list is called `list`.
    pub(super) fn new(text: &'a str, list: &str) -> Self {
        Self {
            text,
            list: key(list),
            facts: Facts::default(),
            unit: None,
            method: None,
            pending: Vec::new(),
            mode: Mode::Idle,
            is_global: false,
            is_qualified: false,
            is_constant: false,
            in_configuration: false,
            behind: Kind::Semi,
            structures: Vec::new(),
            type_name: String::new(),
            head: Vec::new(),
            names: Vec::new(),
            ty: String::new(),
            value: String::new(),
        }
    }

    /// Takes the next token.
    pub(super) fn take(&mut self, token: Token) {
        let attributes = std::mem::take(&mut self.pending);
        if self.behind == Kind::Dot || !self.keyword(token, &attributes) {
            self.word(token, attributes);
        }
        self.behind = token.kind;
    }

    fn text_of(&self, token: Token) -> &'a str {
        &self.text[token.start as usize..token.end as usize]
    }

    /// Words that mean one thing in every mode.
    fn keyword(&mut self, token: Token, attributes: &Attributes) -> bool {
        use Kind::*;
        match token.kind {
            Program if self.in_configuration => {}
            Function | FunctionBlock | Program => self.begin_unit(attributes),
            Class | Interface if token.starts_line && self.unit.is_none() && self.mode == Mode::Idle => self.begin_unit(attributes),
            EndFunction | EndFunctionBlock | EndProgram | EndClass | EndInterface => self.end_unit(),
            EndMethod | EndProperty | EndAction => (self.method, self.mode) = (None, Mode::Idle),
            Var | VarInput | VarOutput | VarInOut | VarTemp | VarStat | VarInst | VarGlobal | VarExternal | VarGeneric => {
                let attribute = |name: &str| attributes.iter().find(|(known, _)| known == name);
                (self.mode, self.is_global, self.is_constant) = (Mode::Names, token.kind == VarGlobal, false);
                self.is_qualified = attribute("qualified_only").is_some();
                if let Some((_, Some(name))) = attribute("gvl_name") {
                    self.list = key(name);
                }
                self.names.clear();
                self.structures.clear();
            }
            EndVar => self.mode = Mode::Idle,
            Type => (self.mode, self.head) = (Mode::TypeName, attributes.clone()),
            EndType => {
                self.mode = Mode::Idle;
                self.structures.clear();
            }
            EndStruct | EndUnion => {
                self.structures.pop();
                let is_field = !self.structures.is_empty() || self.type_name.is_empty();
                self.mode = if is_field { Mode::Names } else { Mode::TypeName };
                self.names.clear();
            }
            Configuration | EndConfiguration => self.in_configuration = token.kind == Configuration,
            Task if self.in_configuration => self.mode = Mode::TaskName,
            Resource if self.in_configuration => self.mode = Mode::ResourceName,
            _ => return false,
        }
        true
    }

    fn begin_unit(&mut self, attributes: &Attributes) {
        self.end_unit();
        (self.mode, self.head) = (Mode::UnitName, attributes.clone());
    }

    fn end_unit(&mut self) {
        (self.unit, self.method, self.mode) = (None, None, Mode::Idle);
        self.type_name.clear();
    }

    fn word(&mut self, token: Token, attributes: Attributes) {
        use Kind::*;
        let is_modifier = matches!(token.kind, Abstract | Final | Override | Public | Private | Protected | Internal);
        let is_name = token.kind.is_name() && !is_modifier;
        match self.mode {
            Mode::Idle => {
                if matches!(token.kind, Method | Property | Action) && token.starts_line && self.unit.is_some() {
                    (self.mode, self.head) = (Mode::MemberName, attributes);
                }
            }
            Mode::UnitName if is_name => {
                let name = key(self.text_of(token));
                self.facts.pous.entry(name.clone()).or_default().attributes = std::mem::take(&mut self.head);
                (self.unit, self.mode) = (Some(name), Mode::UnitHead);
            }
            Mode::UnitHead => self.mode = if token.kind == Extends { Mode::BaseName } else { Mode::Idle },
            Mode::BaseName if is_name => {
                let base = key(self.text_of(token));
                if let Some(scope) = self.unit.as_ref().and_then(|unit| self.facts.pous.get_mut(unit)) {
                    scope.base = Some(base);
                }
            }
            Mode::BaseName => self.mode = if token.kind == Dot { Mode::BaseName } else { Mode::Idle },
            Mode::MemberName if is_name => {
                let unit = self.unit.as_deref().unwrap_or("");
                let name = format!("{unit}.{}", key(self.text_of(token)));
                self.facts.pous.entry(name.clone()).or_default().attributes = std::mem::take(&mut self.head);
                (self.method, self.mode) = (Some(name), Mode::Idle);
            }
            Mode::UnitName | Mode::MemberName => self.mode = if is_modifier { self.mode } else { Mode::Idle },
            Mode::TypeName => self.type_head(token, attributes),
            Mode::Names => self.name(token, attributes),
            Mode::Type => self.type_word(token),
            Mode::Value if token.kind == Semi => self.finish(),
            Mode::Value => self.value.push_str(self.text_of(token)),
            Mode::TaskName | Mode::ResourceName => {
                let names = if self.mode == Mode::TaskName { &mut self.facts.tasks } else { &mut self.facts.resources };
                names.insert(key(&self.text[token.start as usize..token.end as usize]));
                self.mode = Mode::Idle;
            }
        }
    }

    fn type_head(&mut self, token: Token, attributes: Attributes) {
        match token.kind {
            Kind::Colon => {
                let attributes = std::mem::take(&mut self.head);
                self.facts.types.entry(self.type_name.clone()).or_default().attributes = attributes;
                self.mode = Mode::Type;
                self.names.clear();
                self.ty.clear();
            }
            Kind::Semi => {}
            kind if kind.is_name() && self.behind == Kind::Extends => {
                let base = key(self.text_of(token));
                self.facts.types.entry(self.type_name.clone()).or_default().base = Some(base);
            }
            Kind::Extends => {}
            _ => {
                self.type_name = key(self.text_of(token));
                self.head.extend(attributes);
            }
        }
    }

    fn name(&mut self, token: Token, attributes: Attributes) {
        match token.kind {
            Kind::Semi => self.names.clear(),
            Kind::Colon => {
                self.mode = Mode::Type;
                self.ty.clear();
            }
            kind if kind.is_name() => {
                // Two names in a row: the first was a qualifier of the section.
                if self.behind.is_name() {
                    self.is_constant |= self.behind == Kind::Constant;
                    self.names.pop();
                }
                self.names.push((key(self.text_of(token)), attributes));
            }
            _ => {}
        }
    }

    fn type_word(&mut self, token: Token) {
        match token.kind {
            Kind::Struct | Kind::Union => {
                let is_named = self.names.is_empty() && self.ty.is_empty();
                if !is_named {
                    self.ty.push_str("STRUCT");
                    self.finish();
                }
                self.structures.push(if is_named { self.type_name.clone() } else { String::new() });
                self.mode = Mode::Names;
            }
            Kind::Assign => {
                self.value.clear();
                self.mode = Mode::Value;
            }
            Kind::Semi => self.finish(),
            _ => {
                let word = key(self.text_of(token));
                let touches = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
                if touches(self.ty.chars().last()) && touches(word.chars().next()) {
                    self.ty.push(' ');
                }
                self.ty.push_str(&word);
            }
        }
    }

    /// A declaration is complete.
    fn finish(&mut self) {
        if self.names.is_empty() {
            self.mode = Mode::TypeName;
            self.type_name.clear();
            return;
        }
        self.mode = Mode::Names;
        let (ty, value) = (std::mem::take(&mut self.ty), std::mem::take(&mut self.value));
        for (name, attributes) in std::mem::take(&mut self.names) {
            let variable = Variable { ty: ty.clone(), value: value.clone(), constant: self.is_constant, attributes };
            self.declare(name, variable);
        }
    }

    fn declare(&mut self, name: String, variable: Variable) {
        if let Some(structure) = self.structures.last() {
            if let Some(scope) = self.facts.types.get_mut(structure) {
                scope.variables.insert(name, variable);
            }
        } else if self.is_global {
            self.facts.globals.insert(format!("{}.{name}", self.list), variable.clone());
            if !self.is_qualified {
                self.facts.globals.insert(name, variable);
            }
        } else if let Some(scope) = self.method.as_ref().or(self.unit.as_ref()).and_then(|scope| self.facts.pous.get_mut(scope)) {
            scope.variables.insert(name, variable);
        }
    }
}
