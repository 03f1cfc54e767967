//! Globs on paths relative to an input folder, the same on every platform.
//!
//! `*` stays within a folder, `**` crosses folders, upper and lower case are the same, `\` escapes.

use globset::{GlobBuilder, GlobSet, GlobSetBuilder};

/// A list of globs; a path matches if any of them does.
#[derive(Clone)]
pub struct Globs {
    patterns: Vec<String>,
    set: GlobSet,
}

impl Globs {
    /// The index of the first pattern that is no glob comes with the cause.
    pub fn new(patterns: Vec<String>) -> Result<Self, (usize, String)> {
        let mut builder = GlobSetBuilder::new();
        for (index, pattern) in patterns.iter().enumerate() {
            let plain = pattern.trim_start_matches("./").trim_end_matches('/');
            let glob = GlobBuilder::new(plain)
                .literal_separator(true)
                .case_insensitive(true)
                .backslash_escape(true)
                .build()
                .map_err(|error| (index, error.kind().to_string()))?;
            builder.add(glob);
        }
        let set = builder.build().map_err(|error| (0, error.kind().to_string()))?;
        Ok(Self { patterns, set })
    }

    /// As the user wrote them.
    pub fn patterns(&self) -> &[String] {
        &self.patterns
    }

    /// `relative` has `/` as separator.
    pub fn matches(&self, relative: &str) -> bool {
        self.set.is_match(relative)
    }
}

impl std::fmt::Debug for Globs {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(&self.patterns).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn globs(pattern: &str) -> Globs {
        Globs::new(vec![pattern.to_owned()]).unwrap()
    }

    #[test]
    fn stars_stay_within_a_folder() {
        assert!(globs("*.glb").matches("a.glb"));
        assert!(!globs("*.glb").matches("street/a.glb"));
        assert!(globs("**/*.glb").matches("a.glb"));
        assert!(globs("**/*.glb").matches("street/north/A.GLB"));
        assert!(globs("./props/").matches("props"));
        assert!(globs("props/**").matches("props/a/b.glb"));
    }

    #[test]
    fn a_broken_glob_is_named() {
        let (index, cause) = Globs::new(vec!["a".to_owned(), "b[".to_owned()]).unwrap_err();
        assert_eq!(index, 1);
        assert!(cause.contains("character class"), "{cause}");
    }
}
