//! What is said about a user's program: data with a code and spans, rendered elsewhere.

use crate::Span;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The program runs.
    Warning,
    /// The program does not run.
    Error,
}

/// A second place that matters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// Where.
    pub span: Span,
    /// What is there.
    pub message: String,
}

/// One message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// From the table.
    pub code: Code,
    /// Starts lower-case, names things in backticks, says what was expected and found.
    pub message: String,
    /// Where.
    pub span: Span,
    /// Other places.
    pub notes: Vec<Note>,
    /// What to do.
    pub help: Option<String>,
}

impl Diagnostic {
    /// A message without notes.
    pub fn new(code: Code, span: Span, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), span, notes: Vec::new(), help: None }
    }
    /// Adds a second place.
    pub fn note(mut self, span: Span, message: impl Into<String>) -> Self {
        self.notes.push(Note { span, message: message.into() });
        self
    }
    /// Adds what to do.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
    /// How bad it is: codes starting with W are warnings.
    pub fn severity(&self) -> Severity {
        if self.code.text().starts_with('W') { Severity::Warning } else { Severity::Error }
    }
}

macro_rules! codes {
    ($($code:ident $name:ident $text:literal,)*) => {
        /// The kinds of messages. Each has a page `codes/<CODE>.md`.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Code { $(#[doc = $text] $name,)* }
        impl Code {
            /// `E0301`.
            pub fn text(self) -> &'static str { match self { $(Self::$name => stringify!($code),)* } }
            /// One line on what it means.
            pub fn meaning(self) -> &'static str { match self { $(Self::$name => $text,)* } }
            /// Its page: what it means, why, a wrong and a right example. Markdown.
            pub fn page(self) -> &'static str {
                match self { $(Self::$name => include_str!(concat!("../codes/", stringify!($code), ".md")),)* }
            }
        }
        /// All codes, in order.
        pub fn codes() -> &'static [Code] { &[$(Code::$name,)*] }
    };
}
codes! {
    E0101 UnexpectedCharacter "a character that no ST token starts with",
    E0102 UnterminatedComment "a comment is not closed",
    E0103 UnterminatedString "a string is not closed on its line",
    E0104 BadLiteral "a literal is malformed or too large for any type",
    E0105 UnexpectedToken "another word or sign was expected here",
    E0106 TooDeep "brackets, statements or declarations are nested too deeply",
    E0107 MissingEnd "a block is not closed by its END_",
    E0108 NotSupported "a construct that this version does not support",
    E0109 ErrorPragma "the program says `{error}` itself",
    E0110 BadPragma "a pragma cannot be understood",
    E0201 UnknownName "a name is used but never declared",
    E0202 DuplicateName "a name is declared twice in one scope",
    E0203 UnknownType "a type is used but never declared",
    E0204 UnknownMember "a structure, block or enumeration has no such member",
    E0205 Circular "a type or constant depends on itself",
    E0206 NotAccessible "a variable cannot be seen from here",
    E0301 TypeMismatch "a value has another type than its place",
    E0302 NotAssignable "something that is not a variable is written",
    E0303 BadOperand "an operator does not accept this type",
    E0304 NotConstant "a constant expression was expected",
    E0305 OutOfRange "a constant is outside the range of its type or bounds",
    E0306 NotCallable "something that is not a function or block instance is called",
    E0307 BadArgument "an argument does not fit the parameters",
    E0308 MissingArgument "a needed argument is missing",
    E0309 NotIndexable "something that is not an array is indexed, or with a wrong number of indices",
    E0310 NotPointer "something that is not a pointer is dereferenced",
    E0311 BadStatement "a statement stands where it has no effect or no meaning",
    E0312 DuplicateLabel "a CASE label or jump label occurs twice",
    E0313 DivisionByZero "a constant division by zero",
    E0314 BadInitializer "an initial value does not fit its variable",
    E0315 BadOverride "a method or block does not go with what it overrides or extends",
    E0316 NotImplemented "a block lacks a member that its base or interface asks for",
    E0317 Abstract "an abstract block or method is used as if it had a body",
    E0320 BadAddress "a direct address does not exist or does not go with what lies there",
    E0401 NoProgram "nothing to run: no program or task",
    E0402 BadTask "a task or configuration is not usable",
    E0403 TooLarge "the program needs more memory than an application may have",
    W0101 NoEffect "a declaration that has no effect",
    W0102 WarningPragma "the program says `{warning}` itself",
    E0501 BadFile "a source file is not what its name says, or is damaged",
    E0502 OtherLanguage "a body is written in another language than Structured Text",
    W0201 Unused "a variable is never used",
    W0202 NeverRead "a value is stored and never used",
    W0203 Shadowed "a local name hides a variable of the block or a global one",
    W0301 LossyConversion "an implicit conversion may lose information",
    W0302 ResultUnused "a value is computed and not used",
    W0303 SharedData "two tasks use a variable and one may see it half changed",
    W0304 NeverAssigned "a result is never assigned",
    W0305 ConstantOverflow "a constant does not fit and is cut",
    W0306 SelfAssigned "an assignment changes nothing",
    W0307 Unreachable "a statement is never reached",
    W0308 AlwaysSame "a condition is always TRUE or always FALSE",
    W0309 FloatEquality "REAL values are compared for equality",
    W0310 MissingMember "a CASE leaves out members of its enumeration",
    W0311 TwoWriters "two tasks write the same variable",
    W0312 PointerType "a pointer gets the address of something of another type",
    W0313 NotKept "what points elsewhere is not kept over a restart",
    W0320 SharedAddress "two variables lie at addresses that overlap",
    W0321 NoAddress "a variable waits for an address and gets none",
}

/// The page of a code such as `E0301`, in any case of its letter; `None` if there is no such code.
pub fn explain(code: &str) -> Option<&'static str> {
    codes().iter().find(|known| known.text().eq_ignore_ascii_case(code)).map(|known| known.page())
}
