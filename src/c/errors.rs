//! Errors as codes with a text per thread.

use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use svl_core::Error;

/// `svl_status`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    Ok = 0,
    Invalid = 1,
    File = 2,
    NoResult = 3,
    Internal = 4,
    Memory = 5,
}

/// A failed call: its code and its text.
#[derive(Debug)]
pub struct Failure {
    pub status: Status,
    pub text: String,
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match error {
            Error::Io { .. } | Error::Format { .. } => Status::File,
            Error::Panicked => Status::Internal,
            Error::Memory { .. } => Status::Memory,
            _ => Status::Invalid,
        };
        Self {
            status,
            text: error.to_string(),
        }
    }
}

impl Failure {
    pub fn no_result() -> Self {
        Self {
            status: Status::NoResult,
            text: "no pair was matched yet; call svl_match first".into(),
        }
    }
}

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// The status of `call`; its error becomes the last one of this thread. No panic leaves it.
pub fn guarded(call: impl FnOnce() -> Result<(), Failure>) -> Status {
    let result =
        catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|_| Err(Error::Panicked.into()));
    let Err(Failure { status, text }) = result else {
        return Status::Ok;
    };
    let text = CString::new(text.replace('\0', "")).unwrap_or_default();
    LAST.with(|last| *last.borrow_mut() = text);
    status
}

pub fn last() -> *const c_char {
    LAST.with(|last| last.borrow().as_ptr())
}
