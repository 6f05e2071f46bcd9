//! The table of options in `docs/CLI.md` is what `--help` says. `VG_BLESS=1 cargo test -p vg-cli --bin vg documented`
//! rewrites it.

use super::Cli;
use clap::{Arg, CommandFactory};
use std::fmt::Write;
use vg_testing::root;
use vg_testing::tools::assert_golden;

const START: &str =
    "<!-- The options, generated from the program: cargo test -p vg-cli --bin vg documented -->\n";
const END: &str = "<!-- The end of the options. -->\n";

/// An option, and the commands that have it.
struct Row {
    option: String,
    meaning: String,
    commands: Vec<String>,
}

fn rows() -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for command in Cli::command().get_subcommands() {
        for arg in command.get_arguments().filter(|arg| arg.get_long().is_some() && !arg.is_hide_set()) {
            let (option, meaning) = (option(arg), meaning(arg));
            let name = command.get_name().to_owned();
            match rows.iter_mut().find(|row| row.option == option && row.meaning == meaning) {
                Some(row) => row.commands.push(name),
                None => rows.push(Row { option, meaning, commands: vec![name] }),
            }
        }
    }
    rows
}

/// `--prior auto\|given`, `-o, --output FILE`.
fn option(arg: &Arg) -> String {
    let short = arg.get_short().map_or_else(String::new, |short| format!("-{short}, "));
    let long = arg.get_long().unwrap_or_default();
    let names = arg.get_value_names().unwrap_or_default().join(" ").replace('|', "\\|");
    let value = match (arg.get_action().takes_values(), arg.is_require_equals_set()) {
        (false, _) => String::new(),
        (true, true) => format!("[={names}]"),
        (true, false) if is_list(arg) || words(arg).is_empty() => format!(" {names}"),
        (true, false) => format!(" {}", words(arg).join("\\|")),
    };
    format!("`{short}--{long}{value}`")
}

fn is_list(arg: &Arg) -> bool {
    arg.get_value_delimiter().is_some()
}

fn words(arg: &Arg) -> Vec<String> {
    arg.get_possible_values().iter().map(|value| value.get_name().to_owned()).collect()
}

fn meaning(arg: &Arg) -> String {
    let mut meaning = arg.get_help().map(ToString::to_string).unwrap_or_default();
    if is_list(arg) {
        let _ = write!(meaning, ": `{}`", words(arg).join("`, `"));
    }
    let defaults = arg.get_default_values();
    if arg.get_action().takes_values() && !defaults.is_empty() && !defaults[0].is_empty() {
        let _ = write!(meaning, " (default `{}`)", defaults[0].to_string_lossy());
    }
    meaning.replace('|', "\\|").replace('<', "&lt;")
}

#[test]
fn the_documented_options_are_the_programs() {
    let path = root().join("docs/CLI.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let mut table = "| option | commands | meaning |\n| --- | --- | --- |\n".to_owned();
    for row in rows() {
        let _ = writeln!(table, "| {} | {} | {} |", row.option, row.commands.join(", "), row.meaning);
    }
    let (before, rest) = page.split_once(START).expect("where the options begin");
    let (_, after) = rest.split_once(END).expect("where they end");
    let why = "VG_BLESS=1 cargo test -p vg-cli --bin vg documented rewrites docs/CLI.md";
    assert_golden(&path, &format!("{before}{START}\n{table}\n{END}{after}"), why);
}
