//! Every course can be passed: a driver with perfect sight passes it before it is used. A layout in
//! which that driver does not finish is rejected, and the next one is drawn.

use super::course::Course;
use super::source::Drive;
use svl_core::depth::{GridSettings, grid};
use svl_core::{Error, Result};
use svl_score::drive::{DriveEvent, RobotState};
use svl_score::scenario::{DriveConfig, Scenario, ScenarioSource};
use svl_sim::arena::ArenaConfig;

/// Largest number of layouts that are drawn for a course.
const MAX_LAYOUTS: u32 = 30;

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
        for attempt in 0..MAX_LAYOUTS {
            let course = Self::draw(arena, drive, seed, attempt)?;
            if let Some(route) = course.proof(settings)? {
                return Ok(course.with_route(route));
            }
        }
        Err(Error::Invalid(format!(
            "course {seed}: none of {MAX_LAYOUTS} layouts can be passed even with perfect sight; \
             drive.gap_m = {} may be too narrow for the robot, or drive.steering unfit",
            drive.gap_m
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
        let rig = self.world().rig();
        let mut drive = Drive::new(self, self.frame_s());
        let mut route = Vec::new();
        while drive.step(self) {
            if drive.log.events().any(DriveEvent::ends_proof) {
                return Ok(None);
            }
            route.push(drive.robot());
            let (pose, _) = drive.view(&gait);
            let disparity = self.world().disparity(&pose)?;
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
