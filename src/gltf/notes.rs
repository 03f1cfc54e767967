//! What a user should know about a written file although nothing failed: one note per matter, however often it occurs.

use std::collections::BTreeSet;

/// Something that was left out or done differently, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// JSON place of the first occurrence in the source.
    pub place: String,
    /// In words, lowercase, without the place.
    pub text: String,
    /// In how many places.
    pub count: usize,
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.place, self.text)?;
        match self.count {
            0 | 1 => Ok(()),
            2 => write!(f, " (and in one more place)"),
            count => write!(f, " (and in {} more places)", count - 1),
        }
    }
}

/// Collects notes in the order of their first occurrence.
#[derive(Clone, Debug, Default)]
pub(super) struct Notes(Vec<(Note, BTreeSet<String>)>);

impl Notes {
    pub(super) fn add(&mut self, place: impl std::fmt::Display, text: impl Into<String>) {
        let (place, text) = (place.to_string(), text.into());
        match self.0.iter_mut().find(|(note, _)| note.text == text) {
            Some((note, places)) => note.count += usize::from(places.insert(place)),
            None => self.0.push((Note { place: place.clone(), text, count: 1 }, BTreeSet::from([place]))),
        }
    }

    pub(super) fn into_vec(self) -> Vec<Note> {
        self.0.into_iter().map(|(note, _)| note).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_texts_are_one_note() {
        let mut notes = Notes::default();
        notes.add("nodes[1]", "x is odd");
        notes.add("nodes[2]", "y is odd");
        notes.add("nodes[3]", "x is odd");
        notes.add("nodes[3]", "x is odd");
        let words: Vec<String> = notes.into_vec().iter().map(ToString::to_string).collect();
        assert_eq!(words, ["nodes[1]: x is odd (and in one more place)", "nodes[2]: y is odd"]);
    }
}
