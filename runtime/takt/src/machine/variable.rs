//! Variables as people name them outside.

use super::VariableError;
use takt_ir::{Place, Program};

/// The place of a variable that may be written from outside, by its path.
pub fn writable(program: &Program, path: &str) -> Result<Place, VariableError> {
    let place = takt_ir::resolve(program, path).map_err(VariableError::Name)?;
    match takt_engine::writable(program, place) {
        Ok(_) => Ok(place),
        Err(error) => Err(VariableError::Access { path: path.into(), error }),
    }
}

/// A variable that may be written, and the bytes of an ST literal of its type.
pub fn assignment(program: &Program, path: &str, value: &str) -> Result<(Place, Box<[u8]>), VariableError> {
    let place = writable(program, path)?;
    let bytes = takt_ir::parse_value(&program.types, place.ty, value).map_err(VariableError::Value)?;
    Ok((place, bytes.into()))
}
