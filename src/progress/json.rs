//! Events as JSON lines, for programs.

use std::io::Write;
use std::sync::Mutex;

use super::{Event, Reporter, Sink, write_line};

/// Writes each event as one JSON object on one line, at once.
pub struct JsonLines {
    sink: Sink,
}

impl JsonLines {
    /// Lines go to `sink`.
    pub fn new(sink: Box<dyn Write + Send>) -> Self {
        Self { sink: Mutex::new(sink) }
    }
}

impl Reporter for JsonLines {
    fn event(&self, event: &Event) {
        let line = serde_json::to_string(event).expect("events hold only strings and finite numbers");
        write_line(&self.sink, &line);
    }
}
