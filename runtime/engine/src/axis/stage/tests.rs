//! Tests of the axis stage.
