//! An evaluation as people read it.

use super::{Candidate, Evaluation, Facts};
use crate::progress::quantity::{bytes, count};
use crate::report::{columns, percent};

/// Right-aligned columns: all but the name.
fn right(header: &[&str]) -> Vec<usize> {
    (1..header.len()).collect()
}

impl Evaluation {
    /// Tables that fit a terminal: sizes and looks, then surfaces and textures, then what could not be shown.
    pub fn to_text(&self) -> String {
        let mut text = self.looks();
        text += "\n\n";
        text += &self.surfaces();
        let all = std::iter::once(&self.reference).chain(self.candidates.iter().map(|c| &c.facts));
        for (facts, note) in all.flat_map(|facts| facts.notes.iter().map(move |note| (facts, note))) {
            text.extend(["\n", &facts.name, ": ", note]);
        }
        text + "\n"
    }

    fn looks(&self) -> String {
        let header = ["", "triangles", "", "bytes", "d_RMS", "worst view", "silhouette", "SSIM"];
        let share = |facts: &Facts| percent(facts.triangles as f64 / self.reference.triangles.max(1) as f64);
        let mut rows = vec![vec![
            self.reference.name.clone(),
            count(self.reference.triangles),
            String::new(),
            bytes(self.reference.bytes),
        ]];
        let row = |candidate: &Candidate| {
            let worst = candidate.views.get(candidate.worst_view as usize).copied().unwrap_or(0.0);
            vec![
                candidate.facts.name.clone(),
                count(candidate.facts.triangles),
                share(&candidate.facts),
                bytes(candidate.facts.bytes),
                format!("{:.3}", candidate.d_rms),
                format!("{worst:.3} (#{})", candidate.worst_view),
                percent(candidate.silhouette),
                format!("{:.4}", candidate.ssim),
            ]
        };
        rows.extend(self.candidates.iter().map(row));
        rows[0].resize(header.len(), String::new());
        let note =
            format!("(24 views of {0}×{0} pixels, drawn by {1}; d_RMS: luminance 0…255)", self.size, self.renderer);
        columns(&header, rows, &right(&header)) + "\n" + &note
    }

    fn surfaces(&self) -> String {
        let header = ["surface, of the radius", "mean", "rms", "max", "texture rms", "max", "stretch"];
        let length = |value: f64| percent(value / self.radius);
        let stretch = |facts: &Facts| facts.stretch.map_or_else(|| "–".to_owned(), |s| format!("{:.2}", s.l2));
        let mut rows = vec![vec![self.reference.name.clone()]];
        rows[0].resize(header.len() - 1, String::new());
        rows[0].push(stretch(&self.reference));
        let row = |candidate: &Candidate| {
            let mut row = vec![candidate.facts.name.clone()];
            row.extend(match &candidate.surface {
                Some(s) => {
                    // Mean and rms of both directions, the larger.
                    let most = |of: fn(&crate::compare::Distances) -> f64| length(of(&s.forward).max(of(&s.backward)));
                    [most(|d| d.mean), most(|d| d.rms), most(|d| d.max)]
                }
                None => ["–"; 3].map(str::to_owned),
            });
            row.extend(match &candidate.texture {
                Some(t) => [length(t.distances.rms), length(t.distances.max)],
                None => ["–"; 2].map(str::to_owned),
            });
            row.push(stretch(&candidate.facts));
            row
        };
        rows.extend(self.candidates.iter().map(row));
        columns(&header, rows, &right(&header))
    }
}
