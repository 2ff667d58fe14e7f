//! The account of a run at the end of a recording.

use nirspi_camera::account::LossCounters;
use serde::{Deserialize, Serialize};

/// The account of a run, as the capture wrote it.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct RunAccount {
    /// The loss counters.
    #[serde(flatten)]
    pub counters: LossCounters,
    /// Frames requested; `None` if the run went on until stopped.
    #[serde(default)]
    pub asked: Option<u32>,
    /// Frames that the camera reports to have made; `None` if the camera could not report.
    #[serde(default)]
    pub made: Option<u64>,
    /// What the run lacks, in one line; `None` if nothing is missing.
    #[serde(default)]
    pub missing: Option<String>,
    /// Name of the file in which the recording goes on; `None` if the run ended in this file. The
    /// counters are of this file, [`asked`](Self::asked) and [`made`](Self::made) of the whole run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub continues: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_account_of_an_older_recording_still_reads() {
        let old = r#"{"received":7,"lost":1,"corrupt":0,"late":0}"#;
        let account: RunAccount = serde_json::from_str(old).unwrap();
        let counters = LossCounters { received: 7, lost: 1, ..Default::default() };
        assert_eq!(account, RunAccount { counters, ..Default::default() });
        let json = serde_json::to_string(&account).unwrap();
        assert!(json.starts_with(r#"{"received":7,"#), "{json}");
        assert_eq!(serde_json::from_str::<LossCounters>(&json).unwrap(), counters);
    }
}
