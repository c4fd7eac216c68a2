//! The host while it is recorded, and the one that plays a recording back.
//!
//! Calls are numbered: a program that is in the same state makes the same calls, so the number of the call is all that an answer needs to come back at
//! the right moment. What a program writes to files is not written again.

use super::header::Calls;
use super::stream::Stream;
use std::any::Any;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use takt_abi::{Chunk, Host, HostError, Request, Ticket};

/// Wraps a host and tells a recording what it answers.
pub struct Told {
    inner: Box<dyn Host>,
    stream: Rc<RefCell<Option<Stream>>>,
    calls: Rc<RefCell<Calls>>,
}

impl Told {
    /// Calls are counted from now on.
    pub fn new(inner: Box<dyn Host>, stream: Rc<RefCell<Option<Stream>>>, calls: Rc<RefCell<Calls>>) -> Self {
        Self { inner, stream, calls }
    }
}

impl Host for Told {
    fn submit(&mut self, request: Request, buffer: &mut Vec<u8>) -> Result<Ticket, HostError> {
        let result = self.inner.submit(request, buffer);
        let mut calls = self.calls.borrow_mut();
        let call = calls.submits;
        calls.submits += 1;
        match result {
            Ok(_) => calls.accepted += 1,
            Err(error) => {
                if let Some(stream) = self.stream.borrow_mut().as_mut() {
                    stream.refused(call, error);
                }
            }
        }
        result
    }
    fn latch(&mut self, wait: bool) {
        self.inner.latch(wait);
    }
    fn take(&mut self, ticket: Ticket) -> Option<Result<Chunk, HostError>> {
        let result = self.inner.take(ticket);
        let mut calls = self.calls.borrow_mut();
        let call = calls.takes;
        calls.takes += 1;
        if let (Some(result), Some(stream)) = (&result, self.stream.borrow_mut().as_mut()) {
            stream.take(call, result);
        }
        result
    }
    fn save(&mut self) -> Option<Box<dyn Any + Send>> {
        let calls = *self.calls.borrow();
        self.inner.save().map(|inner| Box::new((calls, inner)) as Box<dyn Any + Send>)
    }
    fn restore(&mut self, saved: &dyn Any) -> bool {
        let Some((calls, inner)) = saved.downcast_ref::<(Calls, Box<dyn Any + Send>)>() else { return false };
        *self.calls.borrow_mut() = *calls;
        self.inner.restore(inner.as_ref())
    }
}

/// What a recording has for the host.
#[derive(Debug, Clone, Default)]
pub struct Answers {
    /// How far it is.
    pub calls: Calls,
    /// By call of `take`.
    pub taken: VecDeque<(u64, Result<Chunk, HostError>)>,
    /// By call of `submit`.
    pub refused: VecDeque<(u64, HostError)>,
}

/// Plays answers back.
pub struct Played(pub Rc<RefCell<Answers>>);

impl Host for Played {
    fn submit(&mut self, _: Request, buffer: &mut Vec<u8>) -> Result<Ticket, HostError> {
        let mut answers = self.0.borrow_mut();
        let call = answers.calls.submits;
        answers.calls.submits += 1;
        if answers.refused.front().is_some_and(|(at, _)| *at == call)
            && let Some((_, error)) = answers.refused.pop_front()
        {
            return Err(error);
        }
        answers.calls.accepted += 1;
        buffer.clear();
        Ok(Ticket(answers.calls.accepted))
    }
    fn latch(&mut self, _: bool) {}
    fn take(&mut self, _: Ticket) -> Option<Result<Chunk, HostError>> {
        let mut answers = self.0.borrow_mut();
        let call = answers.calls.takes;
        answers.calls.takes += 1;
        if answers.taken.front().is_some_and(|(at, _)| *at == call) { answers.taken.pop_front().map(|(_, result)| result) } else { None }
    }
}
