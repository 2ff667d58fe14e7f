//! What the numbers of a pattern mean, for error messages.

pub use nirspi_recon::law::Form;

/// The meaning of a pattern's numbers.
pub(super) fn meaning(form: Form) -> &'static str {
    match form {
        Form::Pairs => "a +, - pair a row",
        Form::Halves => "a + and a - for each row",
        Form::Single => "one reading a row",
        Form::Differences => "one difference a row",
    }
}
