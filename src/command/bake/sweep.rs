//! Outputs of scenes that are no longer there.

use std::collections::BTreeSet;

use super::Session;
use crate::index::Seen;
use crate::progress::Event;
use crate::scan::Scan;

impl Session<'_> {
    /// Removes outputs of scenes that vanished or are skipped now: those that are still what lodbake wrote, and that no
    /// other scene has.
    pub fn sweep(&mut self, found: &Scan) {
        let skipped = |relative: &str| self.pipeline.settings_for(relative).skip;
        let present: Vec<&str> =
            found.files.iter().map(|f| f.relative.as_str()).filter(|relative| !skipped(relative)).collect();
        let vanished = self.index.take_vanished(present);
        if vanished.is_empty() {
            return;
        }
        let in_use: BTreeSet<String> =
            self.index.entries().flat_map(|(_, entry)| entry.outputs.iter().map(|o| o.relative.clone())).collect();
        for (relative, entry) in vanished {
            for output in entry.outputs.iter().filter(|o| !in_use.contains(&o.relative)) {
                let path = self.pipeline.output.path.join(&output.relative);
                let is_ours = Seen::read(&path).is_ok_and(|seen| seen.content == output.seen.content);
                if is_ours && let Err(error) = std::fs::remove_file(&path) {
                    self.warn_run(&format!("failed to remove `{}`: {error}", path.display()));
                }
            }
            self.context.reporter.event(&Event::SceneVanished { path: relative });
        }
    }
}
