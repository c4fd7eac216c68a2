//! Statements that are never reached, that change nothing, or that decide what is decided already.

use super::Known;
use crate::scope::key;
use crate::unit::Compiler;
use takt_syntax::tree::{AssignOp, Expr, ExprKind, Stmt, StmtKind};
use takt_syntax::{Code, Note};

impl<'a> Compiler<'a> {
    pub(super) fn lint_statements(&mut self, pou: usize, known: &Known) {
        self.lint_list(self.pous[pou].tree.body, known);
    }

    fn lint_list(&mut self, list: &'a [Stmt], known: &Known) {
        let mut left: Option<&'a Stmt> = None;
        for statement in list {
            match (&statement.kind, left) {
                (StmtKind::Label(_), _) => left = None,
                (StmtKind::Empty, _) | (_, None) => {}
                (_, Some(leaving)) => {
                    let diagnostic = self.report(Code::Unreachable, statement.span, "nothing reaches this statement");
                    diagnostic.notes.push(Note { span: leaving.span, message: "what stands behind this is left out".into() });
                    return;
                }
            }
            self.lint_statement(statement, known);
            if leaves(statement) {
                left = Some(statement);
            }
        }
    }

    fn lint_statement(&mut self, statement: &'a Stmt, known: &Known) {
        match &statement.kind {
            StmtKind::Assign { targets, value } => {
                if let [(target, AssignOp::Assign)] = targets.as_slice()
                    && same(target, value, known)
                {
                    let diagnostic = self.report(Code::SelfAssigned, statement.span, "this assigns a variable to itself");
                    diagnostic.help = Some("remove it, or name the variable that was meant".into());
                }
            }
            StmtKind::If { arms, otherwise } => {
                for (condition, body) in arms {
                    self.lint_condition(condition);
                    self.lint_list(body, known);
                }
                self.lint_list(otherwise.as_deref().unwrap_or_default(), known);
            }
            StmtKind::Case { arms, otherwise, .. } => {
                arms.iter().for_each(|(_, body)| self.lint_list(body, known));
                self.lint_list(otherwise.as_deref().unwrap_or_default(), known);
            }
            StmtKind::For { body, .. } | StmtKind::While { body, .. } | StmtKind::Repeat { body, .. } => self.lint_list(body, known),
            StmtKind::Try { body, catch, finally } => {
                self.lint_list(body, known);
                self.lint_list(catch.as_ref().map(|c| c.1.as_slice()).unwrap_or_default(), known);
                self.lint_list(finally.as_deref().unwrap_or_default(), known);
            }
            _ => {}
        }
    }

    /// A condition of literals alone. Named constants are how programs are configured, and `WHILE TRUE` is how endless loops are written.
    fn lint_condition(&mut self, condition: &'a Expr) {
        if is_literal(condition) {
            let diagnostic = self.report(Code::AlwaysSame, condition.span, "this condition never changes");
            diagnostic.help = Some("remove the IF, or name the constant that switches it".into());
        }
    }
}

/// Whether what stands behind a statement is not run after it.
fn leaves(statement: &Stmt) -> bool {
    let last = |list: &[Stmt]| list.iter().rfind(|s| !matches!(s.kind, StmtKind::Empty)).is_some_and(leaves);
    match &statement.kind {
        StmtKind::Return | StmtKind::Exit | StmtKind::Continue | StmtKind::Jump(_) => true,
        StmtKind::If { arms, otherwise: Some(otherwise) } => last(otherwise) && arms.iter().all(|(_, body)| last(body)),
        _ => false,
    }
}

fn is_literal(e: &Expr) -> bool {
    match &e.kind {
        ExprKind::Literal(_) => true,
        ExprKind::Unary(_, a) => is_literal(a),
        ExprKind::Binary(_, a, b) => is_literal(a) && is_literal(b),
        ExprKind::Chain(first, links) => is_literal(first) && links.iter().all(|link| is_literal(&link.right)),
        _ => false,
    }
}

/// Whether two paths name the same variable, and reading and writing it does nothing else.
fn same(a: &Expr, b: &Expr, known: &Known) -> bool {
    let plain = |x: &str, y: &str| x.eq_ignore_ascii_case(y) && !known.properties.contains(&key(x));
    match (&a.kind, &b.kind) {
        (ExprKind::Name(x), ExprKind::Name(y)) => plain(x, y),
        (ExprKind::Global(x), ExprKind::Global(y)) => plain(&x.text, &y.text),
        (ExprKind::Member(x, m), ExprKind::Member(y, n)) => plain(&m.text, &n.text) && same(x, y, known),
        (ExprKind::Deref(x), ExprKind::Deref(y)) => same(x, y, known),
        (ExprKind::Part(x, p), ExprKind::Part(y, q)) => p == q && same(x, y, known),
        (ExprKind::Index(x, i), ExprKind::Index(y, j)) => {
            same(x, y, known) && i.len() == j.len() && i.iter().zip(j).all(|(i, j)| same(i, j, known))
        }
        (ExprKind::Literal(x), ExprKind::Literal(y)) => x.value == y.value,
        (ExprKind::This, ExprKind::This) => true,
        _ => false,
    }
}
