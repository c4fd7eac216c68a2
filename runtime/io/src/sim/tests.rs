//! The segment as a master sees it.
