//! Kinds of tokens, and the words that are keywords.
//!
//! Promises: a word is looked up without allocation, in any spelling of its letters. Reserved words are never names; the contextual ones (those of
//! the third edition of IEC 61131-3 and of configurations) are names wherever a name is wanted.

macro_rules! kinds {
    (signs { $($sign:ident $sign_text:literal,)* } reserved { $($word:ident $text:literal,)* } contextual { $($soft:ident $soft_text:literal,)* }) => {
        /// What a token is.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(u8)]
        pub(crate) enum Kind { $($sign,)* $($word,)* $($soft,)* }
        impl Kind {
            /// As messages call it: the spelling, or for classes of tokens a description.
            pub(crate) fn text(self) -> &'static str {
                match self { $(Self::$sign => $sign_text,)* $(Self::$word => $text,)* $(Self::$soft => $soft_text,)* }
            }
            /// Whether a name may be spelled so.
            #[inline]
            pub(crate) fn is_name(self) -> bool { self == Self::Ident || self.is_contextual() }
            /// Whether it is a keyword only in certain places.
            #[inline]
            pub(crate) fn is_contextual(self) -> bool { matches!(self, $(Self::$soft)|*) }
            /// Whether it is a keyword everywhere.
            pub(crate) fn is_reserved(self) -> bool { matches!(self, $(Self::$word)|*) }
        }
        const WORDS: &[(&str, Kind)] = &[$(($text, Kind::$word),)* $(($soft_text, Kind::$soft),)*];
    };
}
kinds! {
    signs {
        Eof "the end of the file", Bad "an unreadable sign", Ident "a name", Int "a number", Literal "a literal", Direct "a direct address",
        PartAccess "a part access", Assign ":=", Output "=>", TryAssign "?=", Eq "=", Ne "<>", Lt "<", Le "<=", Gt ">", Ge ">=", Plus "+", Minus "-",
        Star "*", Power "**", Slash "/", Amp "&", Caret "^", Dot ".", DotDot "..", Comma ",", Semi ";", Colon ":", LParen "(", RParen ")",
        LBracket "[", RBracket "]", Hash "#",
    }
    reserved {
        If "IF", Then "THEN", Elsif "ELSIF", Else "ELSE", EndIf "END_IF", Case "CASE", Of "OF", EndCase "END_CASE", For "FOR", To "TO", By "BY",
        Do "DO", EndFor "END_FOR", While "WHILE", EndWhile "END_WHILE", Repeat "REPEAT", Until "UNTIL", EndRepeat "END_REPEAT", Exit "EXIT",
        Return "RETURN", Jmp "JMP", Try "__TRY", Catch "__CATCH", Finally "__FINALLY", EndTry "__ENDTRY",
        And "AND", Or "OR", Xor "XOR", Not "NOT", Mod "MOD", AndThen "AND_THEN", OrElse "OR_ELSE", True "TRUE", False "FALSE",
        Function "FUNCTION", EndFunction "END_FUNCTION", FunctionBlock "FUNCTION_BLOCK", EndFunctionBlock "END_FUNCTION_BLOCK",
        Program "PROGRAM", EndProgram "END_PROGRAM", Type "TYPE", EndType "END_TYPE", Struct "STRUCT", EndStruct "END_STRUCT",
        EndUnion "END_UNION", Var "VAR", VarInput "VAR_INPUT", VarOutput "VAR_OUTPUT", VarInOut "VAR_IN_OUT", VarTemp "VAR_TEMP",
        VarStat "VAR_STAT", VarInst "VAR_INST", VarGlobal "VAR_GLOBAL", VarExternal "VAR_EXTERNAL", VarConfig "VAR_CONFIG", VarGeneric "VAR_GENERIC",
        VarAccess "VAR_ACCESS", EndVar "END_VAR", Array "ARRAY", At "AT", Configuration "CONFIGURATION",
        EndConfiguration "END_CONFIGURATION", EndResource "END_RESOURCE", EndInterface "END_INTERFACE", EndMethod "END_METHOD",
        EndProperty "END_PROPERTY", EndGet "END_GET", EndSet "END_SET", EndAction "END_ACTION", EndClass "END_CLASS",
        EndNamespace "END_NAMESPACE",
    }
    contextual {
        Abstract "ABSTRACT", Final "FINAL", Override "OVERRIDE", Public "PUBLIC", Private "PRIVATE", Protected "PROTECTED", Internal "INTERNAL",
        Method "METHOD", Property "PROPERTY", Get "GET", Set "SET", Action "ACTION", Interface "INTERFACE", Class "CLASS",
        Namespace "NAMESPACE", Using "USING", Extends "EXTENDS", Implements "IMPLEMENTS", This "THIS", Super "SUPER", Union "UNION",
        Pointer "POINTER", Reference "REFERENCE", RefTo "REF_TO", Constant "CONSTANT", Retain "RETAIN", NonRetain "NON_RETAIN",
        Persistent "PERSISTENT", Resource "RESOURCE", Task "TASK", With "WITH", On "ON", Continue "CONTINUE",
    }
}

/// The keyword that `word` spells, or [`Kind::Ident`].
#[inline]
pub(crate) fn word_kind(word: &str) -> Kind {
    let Some(bucket) = BUCKETS.get(word.len()) else { return Kind::Ident };
    for &index in bucket {
        if index == NONE {
            break;
        }
        let (text, kind) = WORDS[index as usize];
        if text.eq_ignore_ascii_case(word) {
            return kind;
        }
    }
    Kind::Ident
}

const NONE: u8 = u8::MAX;

/// Indices into `WORDS` by the length of the word.
const BUCKETS: [[u8; 24]; 20] = buckets();

const fn buckets() -> [[u8; 24]; 20] {
    let mut table = [[NONE; 24]; 20];
    let mut index = 0;
    while index < WORDS.len() {
        let length = WORDS[index].0.len();
        let mut slot = 0;
        while table[length][slot] != NONE {
            slot += 1;
        }
        table[length][slot] = index as u8;
        index += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_is_found_in_any_case() {
        for (text, kind) in WORDS {
            assert_eq!(word_kind(text), *kind);
            assert_eq!(word_kind(&text.to_lowercase()), *kind);
        }
        assert_eq!(word_kind("END_IFF"), Kind::Ident);
        assert_eq!(word_kind(""), Kind::Ident);
        assert_eq!(word_kind(&"x".repeat(100)), Kind::Ident);
    }
}
