//! Command-line options that are made of the library's table, `Options::fields`: a field with facts for the program is
//! an option of the program.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use std::sync::LazyLock;
use vg::geometry::options::{Face, Field, Kind, Value, check};
use vg::pipeline::Options;

/// The options of the table, and which of them were given.
#[derive(Clone)]
pub(crate) struct Settings {
    pub(super) options: Options,
    given: Vec<&'static str>,
}

impl Settings {
    /// Whether the field of this name was set on the command line.
    pub(super) fn is_given(&self, name: &str) -> bool {
        self.given.contains(&name)
    }
}

/// A field, and its names on the command line.
struct Row {
    field: Field,
    /// The parser's name of it: the flag in snake case.
    id: String,
    flag: String,
    default: Option<String>,
}

static TABLE: LazyLock<Vec<Row>> = LazyLock::new(|| {
    let fields = Options::fields().into_iter();
    fields.filter(|field| !field.facts.apart.contains(&Face::Program)).map(row).collect()
});

fn row(field: Field) -> Row {
    let name = field.facts.short.unwrap_or(field.name);
    // What is on by default is switched off.
    let id = if field.default == Value::Flag(true) { format!("no_{name}") } else { name.to_owned() };
    let default = match &field.default {
        Value::Absent | Value::Flag(_) | Value::Names(_) => None,
        Value::Name(name) => Some(name.clone()),
        Value::Whole(number) => Some(number.to_string()),
        Value::Real(number) => Some(number.to_string()),
    };
    Row { flag: id.replace('_', "-"), id, default, field }
}

impl Row {
    fn arg(&'static self) -> Arg {
        let facts = &self.field.facts;
        let arg = Arg::new(&*self.id).long(&*self.flag).help(self.help());
        let arg = match self.field.kind {
            Kind::Flag => arg.action(ArgAction::SetTrue),
            Kind::Choice(_) => arg.value_parser(PossibleValuesParser::new(self.names()).map(Value::Name)),
            Kind::Set(_) => {
                let names = PossibleValuesParser::new(self.names().into_iter().chain([ALL]));
                arg.value_parser(names).value_delimiter(',').action(ArgAction::Append)
            }
            Kind::Whole | Kind::MaybeWhole | Kind::Real | Kind::MaybeReal => {
                arg.value_name("N").value_parser(|text: &str| self.number(text))
            }
        };
        let arg = facts.value_name.iter().fold(arg, |arg, name| arg.value_name(*name));
        self.default.iter().fold(arg, |arg, default| arg.default_value(&**default))
    }

    fn help(&self) -> String {
        let help = self.field.facts.help;
        match (self.field.default == Value::Flag(true), help.split_at_checked(1)) {
            (true, Some((first, rest))) => format!("Do not {}{rest}", first.to_lowercase()),
            _ if matches!(self.field.kind, Kind::Set(_)) => format!("{help}, separated by commas"),
            _ => help.to_owned(),
        }
    }

    fn names(&self) -> Vec<&'static str> {
        match self.field.kind {
            Kind::Choice(enumeration) | Kind::Set(enumeration) => {
                enumeration().variants.iter().map(|variant| variant.name).collect()
            }
            _ => Vec::new(),
        }
    }

    fn number(&self, text: &str) -> Result<Value, String> {
        let (value, kind) = match self.field.kind {
            Kind::Whole | Kind::MaybeWhole => (text.parse().ok().map(Value::Whole), "a whole number"),
            _ => (text.parse().ok().map(Value::Real), "a number"),
        };
        let facts = &self.field.facts;
        value.filter(|value| check("", value, facts).is_ok()).ok_or_else(|| match facts.range {
            Some(range) => format!("expected {kind}: {}", range.words),
            None => format!("expected {kind}"),
        })
    }

    /// What the command line says; `None` where it says nothing and there is no default.
    fn value(&self, matches: &ArgMatches) -> Option<Value> {
        match self.field.kind {
            Kind::Flag => {
                Some(Value::Flag(matches.get_flag(&self.id) ^ (self.field.default == Value::Flag(true))))
            }
            Kind::Set(_) => {
                let chosen: Vec<String> = matches.get_many(&self.id)?.cloned().collect();
                let every = || self.names().into_iter().map(str::to_owned).collect();
                Some(Value::Names(if chosen.iter().any(|name| name == ALL) { every() } else { chosen }))
            }
            _ => matches.get_one(&self.id).cloned(),
        }
    }
}

/// Everything of a set.
const ALL: &str = "all";

impl Args for Settings {
    fn augment_args(command: Command) -> Command {
        command.args(TABLE.iter().map(Row::arg))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for Settings {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut settings = Self { options: Options::default(), given: Vec::new() };
        settings.update_from_arg_matches(matches)?;
        Ok(settings)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        for row in TABLE.iter() {
            let Some(value) = row.value(matches) else { continue };
            let set = self.options.set(row.field.name, value);
            set.map_err(|error| clap::Error::raw(ErrorKind::InvalidValue, error))?;
            if matches.value_source(&row.id) == Some(clap::parser::ValueSource::CommandLine) {
                self.given.push(row.field.name);
            }
        }
        Ok(())
    }
}
