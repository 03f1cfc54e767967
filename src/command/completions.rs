//! `lodbake completions SHELL`: completions for a shell, on standard output.

use clap_complete::Shell;

use super::{Context, Exit};

/// Write completions for a shell to standard output.
#[derive(Clone, Debug, clap::Args)]
pub struct Completions {
    /// The shell, e.g. `lodbake completions bash > ~/.local/share/bash-completion/completions/lodbake`
    pub shell: Shell,
}

impl Completions {
    /// `command` is the whole command line, which only `cli` knows.
    pub fn run(&self, mut command: clap::Command, context: &Context) -> anyhow::Result<Exit> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut command, "lodbake", &mut script);
        context.print(&String::from_utf8_lossy(&script))?;
        Ok(Exit::Fine)
    }
}
