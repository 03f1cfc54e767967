//! Outputs that no scene has any more.

use std::collections::BTreeSet;
use std::path::Path;

use super::Session;
use crate::gltf::library;
use crate::index::{Output, Seen};
use crate::progress::Event;
use crate::scan::Scan;

impl Session<'_> {
    /// Removes outputs of scenes that vanished or are skipped now, and those that baked scenes had before: if they are still what
    /// lodbake wrote, and no other scene has them.
    pub fn sweep(&mut self, found: &Scan) {
        let skipped = |relative: &str| self.pipeline.settings_for(relative).skip;
        let present: Vec<&str> =
            found.files.iter().map(|f| f.relative.as_str()).filter(|relative| !skipped(relative)).collect();
        let vanished = self.index.take_vanished(present);
        let mut stale = self.index.take_superseded();
        for (relative, entry) in vanished {
            stale.extend(entry.outputs);
            self.context.reporter.event(&Event::SceneVanished { path: relative });
        }
        if stale.is_empty() {
            return;
        }
        let in_use: BTreeSet<&str> =
            self.index.entries().flat_map(|(_, entry)| entry.outputs.iter().map(|o| o.relative.as_str())).collect();
        stale.retain(|output| !in_use.contains(output.relative.as_str()));
        // Scenes may have shared one.
        stale.sort_by(|a, b| a.relative.cmp(&b.relative));
        stale.dedup_by(|a, b| a.relative == b.relative && a.seen.content == b.seen.content);
        for output in &stale {
            self.remove(output);
        }
        // Empty, it would be left over; anything else in it stays.
        let _ = std::fs::remove_dir(self.pipeline.output.path.join(library::FOLDER));
    }

    fn remove(&mut self, output: &Output) {
        let path = self.pipeline.output.path.join(Path::new(&output.relative));
        let is_ours = Seen::read(&path).is_ok_and(|seen| seen.content == output.seen.content);
        if is_ours && let Err(error) = std::fs::remove_file(&path) {
            self.warn_run(&format!("failed to remove `{}`: {error}", path.display()));
        }
    }
}
