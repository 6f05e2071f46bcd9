//! Text for the page: escaped names, formatted numbers, and a shell command.

use crate::shown;
use std::ffi::OsString;

/// Escapes text for HTML elements and quoted attributes. Control characters become escape sequences.
pub(super) fn escaped(text: &str) -> String {
    let one = |c: char| match c {
        '&' => "&amp;".into(),
        '<' => "&lt;".into(),
        '>' => "&gt;".into(),
        '"' => "&quot;".into(),
        '\'' => "&#39;".into(),
        '\n' => "\n".into(),
        c if shown::is_plain(c) => c.to_string(),
        c => c.escape_default().to_string(),
    };
    text.chars().map(one).collect()
}

/// PSNR without its unit; "exact" where it is infinite, for identical pictures.
pub(super) fn psnr(db: f64) -> String {
    if db.is_finite() { format!("{db:.2}") } else { "exact".into() }
}

/// A number with `n` decimals; a dash where there is none.
pub(super) fn decimals(value: Option<f64>, n: usize) -> String {
    value.filter(|v| v.is_finite()).map_or_else(|| "–".into(), |v| format!("{v:.n$}"))
}

/// A time with three digits, in milliseconds or seconds.
pub(super) fn ms(ms: f64) -> String {
    match ms {
        ms if ms < 9.995 => format!("{ms:.2} ms"),
        ms if ms < 99.95 => format!("{ms:.1} ms"),
        ms if ms < 9999.5 => format!("{ms:.0} ms"),
        ms => format!("{:.1} s", ms / 1e3),
    }
}

/// A number with four significant digits, more where they are before the decimal point.
pub(super) fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let n = (3 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.n$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// `vg` with these arguments, quoted for a shell where that is needed.
pub(super) fn command(arguments: impl Iterator<Item = OsString>) -> String {
    let words = arguments.map(|word| quoted(&word.to_string_lossy()));
    std::iter::once("vg".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_break_the_page() {
        let found = escaped("<script>\"a\" & 'b'\u{1b}");
        assert_eq!(found, "&lt;script&gt;&quot;a&quot; &amp; &#39;b&#39;\\u{1b}");
    }

    #[test]
    fn a_shell_parses_the_command_as_it_was_given() {
        let words = ["report", "my car", "--box=4.6,1.9,1.5", "it's", ""].map(OsString::from);
        assert_eq!(command(words.into_iter()), r"vg report 'my car' --box=4.6,1.9,1.5 'it'\''s' ''");
    }

    #[test]
    fn numbers_have_four_digits_and_no_needless_zeros() {
        let found = [0.0, 1.5, -0.012345, 123456.7, 3.0, 1e-9].map(number);
        assert_eq!(found, ["0", "1.5", "-0.01235", "123457", "3", "0"]);
        assert_eq!(
            [ms(0.123), ms(12.34), ms(1234.6), ms(21347.0)],
            ["0.12 ms", "12.3 ms", "1235 ms", "21.3 s"]
        );
        assert_eq!([psnr(25.431), psnr(f64::INFINITY)], ["25.43", "exact"]);
        assert_eq!([decimals(Some(0.98765), 3), decimals(None, 3)], ["0.988", "–"]);
    }
}
