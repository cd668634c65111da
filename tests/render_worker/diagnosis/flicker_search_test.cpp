#include "render_worker/diagnosis/flicker_search.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "core/random/counter_random.h"
#include "render_worker/diagnosis/screening.h"
#include "rendered_set.h"

namespace sightline {
namespace {

// Three dozen recordings at odd times, as they are expected.
RecordedSet Planned() {
  RecordingSet description = SmallSetDescription();
  const std::vector<RecordedImage> once = description.recordings;
  for (int round = 1; round <= 2; ++round) {
    for (RecordedImage image : once) {
      if (image.kind == RecordingKind::kLaser) *image.plate_position_id += 100 * round;
      image.repeat_group += 100 * round;
      description.recordings.push_back(image);
    }
  }
  CounterRandom random(7, 0);
  double time_s = 0;
  for (RecordedImage& image : description.recordings) {
    time_s += 5 + 40 * random.Uniform();
    image.timestamp_s = time_s;
  }
  return MakeRecordedSet(std::move(description), {});
}

// Screened where other light is the only thing that is not as expected.
ScreenedEffect ScreenedFor(const ActiveEffect& truth) {
  const Effect* flicker = FindEffect("time.ambient_flicker");
  const RecordedSet set = Planned();
  const SetModel model(set, {});
  FitResult null = LineariseSet(model, {});
  const Screening expected(model, null);
  const Eigen::VectorXd change = expected.linear().Project(expected.ChangeOf(truth));
  Eigen::Index at = 0;
  for (Eigen::VectorXd& residual : null.residual) {
    residual = change.segment(at, residual.size());
    at += residual.size();
  }
  return Screening(model, null).Screen(*flicker);
}

// A bug found: recordings are minutes apart, so that a hundredth of a hertz is another frequency,
// and what flickers was taken for smear or glare.
TEST(FlickerSeen, HasItsFrequencyDepthAndRadiance) {
  for (const double frequency_hz : {33.3, 67.31, 119.98}) {
    const ScreenedEffect screened =
        ScreenedFor({FindEffect("time.ambient_flicker"), {1e-3, 0.8, frequency_hz}});
    const std::vector<double>& found = screened.strongest.parameters;
    EXPECT_NEAR(found[2], frequency_hz, 1e-3);
    // From here a fit finds the rest.
    EXPECT_NEAR(found[0], 1e-3, 2e-4);
    EXPECT_NEAR(found[1], 0.8, 0.25);
  }
}

}  // namespace
}  // namespace sightline
