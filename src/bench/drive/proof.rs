//! Every course can be passed: a driver with perfect sight passes it before it is used. A layout in
//! which that driver does not finish is rejected, and the next one is drawn.

use super::course::Course;
use super::source::Drive;
use serde_json::Value;
use svl_core::depth::{GridSettings, grid};
use svl_core::{Error, Result, joined};
use svl_score::drive::{DriveEvent, RobotState};
use svl_score::scenario::{DriveConfig, Scenario, ScenarioSource};
use svl_sim::arena::ArenaConfig;

/// Largest number of layouts that are drawn for a course.
const MAX_LAYOUTS: u32 = 30;

/// Layouts that are drawn to find the option that is the cause.
const RETRIES: u32 = 5;

/// Everything that a course and its driver depend on, as in a scenario.
#[derive(serde::Serialize, serde::Deserialize)]
struct CourseOptions {
    drive: DriveConfig,
    grid: GridSettings,
    arena: ArenaConfig,
}

impl Default for CourseOptions {
    /// The options of `scenarios/drive.toml`.
    fn default() -> Self {
        Self {
            arena: ArenaConfig {
                frames: 400,
                rate_hz: 6.0,
                ..ArenaConfig::default()
            },
            drive: DriveConfig::default(),
            grid: GridSettings::default(),
        }
    }
}

impl CourseOptions {
    /// The first of that many layouts which can be passed.
    fn passable(&self, seed: u64, layouts: u32) -> Result<Option<Course>> {
        for attempt in 0..layouts {
            let course = Course::draw(&self.arena, &self.drive, seed, attempt)?;
            if let Some(route) = course.proof(self.grid)? {
                return Ok(Some(course.with_route(route)));
            }
        }
        Ok(None)
    }

    /// The option without which a layout can be passed, in words.
    fn cause(&self, seed: u64) -> Result<String> {
        let json = |options: &Self| {
            serde_json::to_value(options).map_err(|error| Error::Invalid(error.to_string()))
        };
        let (given, usual) = (json(self)?, json(&Self::default())?);
        let mut changed = Vec::new();
        differences("", &given, &usual, &mut changed);
        for pointer in &changed {
            let mut options = given.clone();
            // Without one that is usually left out.
            let usual = usual.pointer(pointer).unwrap_or(&Value::Null);
            let Some(value) = options.pointer_mut(pointer) else {
                continue;
            };
            let found = std::mem::replace(value, usual.clone());
            let Ok(options) = serde_json::from_value::<Self>(options) else {
                continue;
            };
            if options.passable(seed, RETRIES)?.is_some() {
                let name = key(pointer);
                return Ok(format!("with {name} = {usual} in place of {found} one can"));
            }
        }
        let keys = joined(changed.iter().map(|pointer| key(pointer)));
        Ok(format!("several of these together are the cause: {keys}"))
    }
}

/// The JSON pointers of the values that differ from usual ones.
fn differences(at: &str, given: &Value, usual: &Value, found: &mut Vec<String>) {
    if let (Value::Object(given), Value::Object(usual)) = (given, usual) {
        for (key, value) in given {
            let usual = usual.get(key).unwrap_or(&Value::Null);
            differences(&format!("{at}/{key}"), value, usual, found);
        }
    } else if given != usual {
        found.push(at.to_owned());
    }
}

/// The key of a scenario at a JSON pointer.
fn key(pointer: &str) -> String {
    pointer.trim_start_matches('/').replace('/', ".")
}

impl Course {
    /// The course with that seed. `arena` has the cameras, the gait and the look of the images.
    ///
    /// # Errors
    /// [`Error::Invalid`] where no layout can be passed, and for a number of `arena` out of its
    /// range.
    pub fn new(
        arena: &ArenaConfig,
        drive: &DriveConfig,
        settings: GridSettings,
        seed: u64,
    ) -> Result<Self> {
        let options = CourseOptions {
            arena: arena.clone(),
            drive: drive.clone(),
            grid: settings,
        };
        if let Some(course) = options.passable(seed, MAX_LAYOUTS)? {
            return Ok(course);
        }
        let cause = options.cause(seed)?;
        Err(Error::Invalid(format!(
            "course {seed}: none of {MAX_LAYOUTS} layouts can be passed even with perfect sight; \
             {cause}"
        )))
    }

    /// A course of a scenario.
    ///
    /// # Errors
    /// The errors of [`Course::new`]; [`Error::Invalid`] for a scenario of another kind.
    pub fn for_scenario(scenario: &Scenario, seed: u64) -> Result<Self> {
        match &scenario.source {
            ScenarioSource::Drive { config, drive, .. } => {
                Self::new(config, drive, scenario.grid, seed)
            }
            _ => Err(Error::Invalid(format!(
                "scenario '{}' has no courses",
                scenario.name
            ))),
        }
    }

    /// The track of a driver that gets the exact grid; none if it does not finish.
    fn proof(&self, settings: GridSettings) -> Result<Option<Vec<RobotState>>> {
        let gait = self.gait();
        let rig = self.world.rig();
        let mut drive = Drive::new(self, self.frame_s());
        let mut route = Vec::new();
        while drive.step(self) {
            if drive.log.events().any(DriveEvent::ends_proof) {
                return Ok(None);
            }
            route.push(drive.robot);
            let (pose, _) = drive.view(&gait);
            let disparity = self.world.disparity(&pose)?;
            drive.decide(self, &grid(&disparity, settings, Some(&rig)));
        }
        Ok(drive.log.arrived.then_some(route))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn courses_differ_are_repeatable_and_can_be_passed() {
        let mut arena = ArenaConfig {
            frames: 400,
            rate_hz: 6.0,
            ..ArenaConfig::default()
        };
        (arena.rig.width_px, arena.rig.height_px) = (80, 60);
        let course = |seed| {
            let settings = GridSettings::default();
            Course::new(&arena, &DriveConfig::default(), settings, seed).unwrap()
        };
        let (one, again, other) = (course(3), course(3), course(4));
        assert_eq!(one.plan(), again.plan());
        assert_ne!(one.plan().outlines, other.plan().outlines);
        let drawn = one.wireframe();
        assert_eq!(drawn.len(), one.plan().outlines.len() + 2);
        assert!(
            drawn
                .iter()
                .any(|thing| thing.name == "route" && thing.strips[0].len() > 9)
        );
        for course in [&one, &other] {
            let route: Vec<_> = course.route().collect();
            let last = route[route.len() - 1];
            assert!(last[1] >= course.goal_m(), "{last:?}");
            let clear = |at: &[f64; 2]| course.clearance_m((*at).into()) > 0.0;
            assert!(route.iter().all(clear));
        }
    }
}
