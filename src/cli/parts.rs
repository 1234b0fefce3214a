//! The parts of a run that the command line names: frames and shards.

use std::ops::Range;

use crate::run::Shard;

/// Reads the frames of `--frames`: `A..B` without B, `A..`, `..B`, or one number.
pub fn frames(text: &str) -> Result<Range<u64>, String> {
    let number = |text: &str, default: u64| match text {
        "" => Ok(default),
        digits => digits.parse::<u64>().map_err(|_| format!("{digits:?} is no frame's number")),
    };
    let range = match text.split_once("..") {
        Some((first, end)) => number(first, 0)?..number(end, u64::MAX)?,
        None => {
            let frame = number(text, u64::MAX)?;
            frame..frame.checked_add(1).ok_or("expected 0..100, 37.., ..100 or 37")?
        }
    };
    match range.is_empty() {
        true => Err(format!("there is no frame from {} up to, and without, {}", range.start, range.end)),
        false => Ok(range),
    }
}

/// Reads the part of `--shard`: `I/N`, or `auto` and `auto/N` for what the scheduler says in the environment.
pub fn shard(text: &str) -> Result<Shard, String> {
    shard_in(text, &|name| std::env::var(name).ok())
}

fn shard_in(text: &str, variable: &dyn Fn(&str) -> Option<String>) -> Result<Shard, String> {
    let number = |what: &str, text: &str| {
        text.parse::<u64>().map_err(|_| format!("{what} is {text:?}: expected a number"))
    };
    let (part, count) = match text.split_once('/') {
        Some((part, count)) => (part, Some(number("the number of parts", count)?)),
        None if text == "auto" => ("auto", None),
        None => return Err("expected I/N, such as 3/16, or `auto`".to_owned()),
    };
    if part != "auto" {
        let count = count.unwrap_or(0);
        return match number("the part", part)? {
            index if (1..=count).contains(&index) => Ok(Shard { index: index - 1, count }),
            index => Err(format!("there is no part {index} of {count}: parts count from 1")),
        };
    }
    let set = |name: &str| variable(name).map(|text| number(name, &text)).transpose();
    if let Some(id) = set("SLURM_ARRAY_TASK_ID")? {
        let first = set("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0);
        let step = set("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1);
        let tasks = set("SLURM_ARRAY_TASK_COUNT")?;
        let count = count
            .or(tasks)
            .ok_or("SLURM_ARRAY_TASK_COUNT is not set: `auto/N` says how many parts there are")?;
        let index = id
            .checked_sub(first)
            .filter(|from_first| from_first % step == 0)
            .map(|from_first| from_first / step);
        return match index.filter(|index| *index < count) {
            Some(index) => Ok(Shard { index, count }),
            None => Err(format!(
                "SLURM_ARRAY_TASK_ID is {id}, which is none of {count} tasks from {first} in steps of {step}"
            )),
        };
    }
    if let Some(index) = set("JOB_COMPLETION_INDEX")? {
        let count = count.ok_or(
            "JOB_COMPLETION_INDEX says which part this is and nothing how many there are: `auto/N` does",
        )?;
        return match index < count {
            true => Ok(Shard { index, count }),
            false => Err(format!(
                "JOB_COMPLETION_INDEX is {index}, and {count} parts count from 0 to {}",
                count.saturating_sub(1)
            )),
        };
    }
    Err("neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_a_range_or_one() {
        assert_eq!(frames("3..7"), Ok(3..7));
        assert_eq!(frames("37"), Ok(37..38));
        assert_eq!((frames("..5"), frames("5..")), (Ok(0..5), Ok(5..u64::MAX)));
        for wrong in ["", "7..7", "7..3", "a..3", "-1", "3-7", "18446744073709551615"] {
            assert!(frames(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn shards_count_from_1_or_come_from_the_scheduler() {
        let of = |text: &str, set: &[(&str, &str)]| {
            shard_in(text, &|name| {
                set.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
            })
        };
        let part = |index, count| Ok(Shard { index, count });
        assert_eq!((of("1/16", &[]), of("16/16", &[])), (part(0, 16), part(15, 16)));
        for wrong in ["0/16", "17/16", "3", "a/b", "1/0", "auto", "auto/4", ""] {
            assert!(of(wrong, &[]).is_err(), "{wrong}");
        }
        let slurm = |id| {
            [
                ("SLURM_ARRAY_TASK_ID", id),
                ("SLURM_ARRAY_TASK_MIN", "4"),
                ("SLURM_ARRAY_TASK_STEP", "2"),
                ("SLURM_ARRAY_TASK_COUNT", "3"),
            ]
        };
        assert_eq!(of("auto", &slurm("8")), part(2, 3));
        assert!(of("auto", &slurm("5")).is_err() && of("auto", &slurm("10")).is_err());
        let index = [("JOB_COMPLETION_INDEX", "3")];
        assert_eq!(of("auto/4", &index), part(3, 4));
        assert!(of("auto/3", &index).is_err() && of("auto", &index).unwrap_err().contains("auto/N"));
    }
}
