//! The commands of pages and scripts.

use super::settings::{Change, ChangeError, Settings};
use super::stage::{SceneState, StageError};
use super::{Shared, lock};
use serde::Serialize;

/// Applies a change of the settings. Returns the new settings.
///
/// # Errors
/// [`ChangeError`] that names the field; then nothing is changed.
pub fn settings(shared: &Shared, json: &[u8]) -> Result<Settings, ChangeError> {
    let change = Change::parse(json)?;
    let mut settings = lock(&shared.settings);
    let changed = settings.with(&change, &shared.offer)?;
    settings.clone_from(&changed);
    drop(settings);
    if let Some(on) = change.run {
        shared.light.set(on);
    }
    shared.slot.wake();
    Ok(changed)
}

/// Changes the scene of a virtual camera. Returns the scene that is shown now.
///
/// # Errors
/// [`StageError`] that names the field; then nothing is changed.
pub fn scene(shared: &Shared, json: &[u8]) -> Result<Option<SceneState>, StageError> {
    shared.stage.change(json)?;
    Ok(shared.stage.state())
}

/// The answer to a command for the LEDs.
#[derive(Debug, Serialize)]
pub struct Switched {
    /// Whether light is allowed now.
    run: bool,
    /// The number of this command; later commands have larger numbers.
    command: u64,
}

/// Allows light, or switches light off.
pub fn switch(shared: &Shared, on: bool) -> Switched {
    let command = shared.light.set(on);
    shared.slot.wake();
    Switched { run: on, command }
}
