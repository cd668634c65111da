// SPDX-License-Identifier: Apache-2.0
// Sets of recordings with effects that are drawn by seed and written down apart, made by the whole
// wave-optical chain (bench/concealed/README.md).
//   make_concealed_sets OUT --seed 1 --nulls 200 --single 90 --pairs 20 --variants 40
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "bench/concealed/effect_draw.h"
#include "bench/concealed/equivalents.h"
#include "bench/concealed/outside_laws/outside_laws.h"
#include "bench/concealed/rig_design.h"
#include "bench/concealed/truth_file.h"
#include "bench/concealed/variant_laws.h"
#include "core/random/counter_random.h"
#include "render_worker/diagnosis/expectation/expected_frame.h"
#include "render_worker/diagnosis/fit/power.h"
#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/effects/stage_name.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/image_file/image_file.h"
#include "render_worker/recordings/plate_frames.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline::bench {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kUndetectable = 5;  // expected gain; with some room for the bisection's end
constexpr double kRoom = 0.95;

struct Options {
  std::string out;
  int64_t seed = 1;
  int nulls = 0, single = 0, pairs = 0, variants = 0;
  int strong = 0, strong_pairs = 0, outside = 0, sealed = 0;
  bool small_nulls = false, small = false;
  bool open_sealed_laws = false;
  int threads = 2;
  std::vector<double> gains = {5, 20, 100};  // expected, to draw from [nats]
  std::vector<double> strong_gains = {1000, 10000};
  std::vector<std::string> only;  // names of sets; none: all
};

// Seeds derive from the numbers: new kinds go to the end.
enum class Kind { kNull, kSingle, kPair, kVariant, kStrong, kStrongPair, kOutside, kSealed };
bool IsStrong(Kind kind) { return kind == Kind::kStrong || kind == Kind::kStrongPair; }
bool IsPair(Kind kind) { return kind == Kind::kPair || kind == Kind::kStrongPair; }
const char* KindName(Kind kind) {
  constexpr const char* kNames[] = {"null",   "single",      "pair",    "variant",
                                    "strong", "strong_pair", "outside", "sealed"};
  return kNames[static_cast<int>(kind)];
}

double DrawTarget(const std::vector<double>& gains, CounterRandom& random) {
  const auto count = static_cast<double>(gains.size());
  return gains[std::min(gains.size() - 1, static_cast<size_t>(count * random.Uniform()))];
}

// The one of 5, 20 and 100 that is nearest.
int GainLevel(double gain) { return gain < 10 ? 5 : gain < std::sqrt(2000.0) ? 20 : 100; }

// Every effect once before any comes again; in a new order every round.
const Effect* InTurn(const std::vector<const Effect*>& effects, uint64_t seed, int index) {
  const int count = static_cast<int>(effects.size());
  std::vector<const Effect*> order = effects;
  CounterRandom random(DeriveSeed(seed, "order", static_cast<uint64_t>(index / count)), 0);
  for (int i = count - 1; i > 0; --i) {
    std::swap(order[i], order[std::min(i, static_cast<int>((i + 1) * random.Uniform()))]);
  }
  return order[index % count];
}

const VariantLaw* FindVariant(const Effect* effect) {
  for (const VariantLaw& law : VariantLaws()) {
    if (law.effect == effect) return &law;
  }
  return nullptr;
}

struct DrawnEffect {
  EffectFamily family;
  ScaledEffect scaled;
  double target = 0;
  int redrawn = 0;
};

// Expected gains in a set, from a null model that is made when it is first needed.
class SetPower {
 public:
  SetPower(const RecordedSet& set, const SetupDeviation& deviation, int threads)
      : set_(set), threads_(threads) {
    truth_.deviations = deviation;
    truth_.deviations.line_position_each_px = 0;  // of every position, not known here
  }

  // `roughly`: as NullInformation::ExpectedGain.
  ExpectedGain Gain(bool roughly = false) {
    if (!information_) {
      SetModelSettings settings;
      settings.threads = threads_;
      information_ = std::make_unique<NullInformation>(set_, settings, truth_);
      gain_of_none_ = information_->ExpectedGain({});  // deviations moved towards the nominal ones
      // Far beyond what deviations could make up for.
      const ActiveEffect sample = {FindEffect("illumination.power_error"), {2}};
      if (const double gain = information_->ExpectedGain({sample}, true);
          !(gain > 0 && std::isfinite(gain))) {
        Fail(set_.description.name + ": the expected gain of a power error is " +
             std::to_string(gain));
      }
    }
    return [this, roughly](const std::vector<ActiveEffect>& effects) {
      // Random effects would count as known there, but they are not.
      if (effects.size() == 1 && HasRandomLaw(*effects[0].effect)) return 0.0;
      return information_->ExpectedGain(effects, roughly) - gain_of_none_;
    };
  }

  // Roughly first: that is enough wherever deviations are about linear.
  ScaledEffect Scaled(const EffectFamily& family, double target) {
    ScaledEffect scaled = ScaleToGain(family, Gain(true), target);
    if (!scaled.gain_known || scaled.gain < kRoom * kUndetectable) return scaled;
    constexpr double kEnough = 0.1;
    const double gain = Gain()({scaled.effect});
    if (std::abs(gain / scaled.gain - 1) > kEnough) return ScaleToGain(family, Gain(), target);
    scaled.gain = gain;
    return scaled;
  }

 private:
  const RecordedSet& set_;
  SetParameters truth_;
  double gain_of_none_ = 0;
  int threads_;
  std::unique_ptr<NullInformation> information_;
};

class Maker {
 public:
  explicit Maker(const Options& options)
      : options_(options), seed_(static_cast<uint64_t>(options.seed)) {
    for (const VariantLaw& law : VariantLaws()) variants_.push_back(law.effect);
    for (const OutsideLaw& law : DevelopmentLaws()) outside_.push_back(law.effect);
    for (const OutsideLaw& law : SealedLaws()) sealed_.push_back(law.effect);
  }

  void Run() {
    const fs::path out = options_.out;
    fs::create_directories(out / "sets");
    fs::create_directories(out / "truth");
    struct Group {
      Kind kind;
      int count;
    };
    Json leave_one_out = Json::array();
    int done = 0;
    const int all = options_.nulls + options_.single + options_.pairs + options_.variants +
                    options_.strong + options_.strong_pairs + options_.outside + options_.sealed;
    for (const auto& [kind, count] :
         {Group{Kind::kNull, options_.nulls}, Group{Kind::kSingle, options_.single},
          Group{Kind::kPair, options_.pairs}, Group{Kind::kVariant, options_.variants},
          Group{Kind::kStrong, options_.strong}, Group{Kind::kStrongPair, options_.strong_pairs},
          Group{Kind::kOutside, options_.outside}, Group{Kind::kSealed, options_.sealed}}) {
      for (int i = 0; i < count; ++i) {
        const auto start = std::chrono::steady_clock::now();
        if (!IsWanted(kind, i)) continue;
        const Json truth = Make(kind, i);
        if (kind == Kind::kSingle) {
          const Json& effect = truth["effects"][0];
          Json exclude = Json::array({effect["effect"]});
          for (const Json& id : effect["accepted"]) {
            if (id != effect["effect"]) exclude.push_back(id);
          }
          leave_one_out.push_back({{"set", truth["set"]}, {"exclude", exclude}});
        }
        const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
        std::printf("%d of %d: %s, %.1f s\n", ++done, all, truth["set"].get<std::string>().c_str(),
                    taken.count());
        std::fflush(stdout);
      }
    }
    WriteJson(out / "leave_one_out.json", leave_one_out);
  }

 private:
  static void WriteJson(const fs::path& path, const Json& json) {
    const fs::path temporary = path.string() + ".part";
    std::ofstream file(temporary);
    file << json.dump(1) << "\n";
    file.close();
    if (!file) Fail(temporary.string() + ": cannot be written");
    fs::rename(temporary, path);
  }

  // The largest strength drawn is four times the family's: a quarter of the shortest exposure.
  static void KeepExposuresPositive(const RecordingSet& set, EffectFamily& family) {
    if (family.effect->description().id != "time.exposure_jitter") return;
    for (const RecordedImage& recording : set.recordings) {
      if (recording.kind == RecordingKind::kDark) continue;
      family.direction[0] = std::min(family.direction[0], recording.exposure_time_s / 16);
    }
  }

  // An effect that this rig can show, at the strength wanted.
  DrawnEffect DrawEffect(SetPower& power, const RecordingSet& set,
                         const std::vector<const Effect*>& from, const Effect* first,
                         CounterRandom& random, const Effect* other, bool strong) {
    // A strong effect may miss its target by half: its law may saturate.
    const double least = strong ? 0.5 * options_.strong_gains.front() : kRoom * kUndetectable;
    DrawnEffect drawn;
    drawn.target = DrawTarget(strong ? options_.strong_gains : options_.gains, random);
    const Effect* effect = first;
    constexpr int kMostDraws = 200;
    for (; drawn.redrawn < kMostDraws; ++drawn.redrawn) {
      if (drawn.redrawn > 0) {
        const int count = static_cast<int>(from.size());
        effect = from[std::min(count - 1, static_cast<int>(count * random.Uniform()))];
      }
      if (other != nullptr && effect->description().stage == other->description().stage) continue;
      drawn.family = DrawFamily(*effect, set.camera, random);
      KeepExposuresPositive(set, drawn.family);
      drawn.scaled = power.Scaled(drawn.family, drawn.target);
      if (!drawn.scaled.gain_known ? !strong : drawn.scaled.gain >= least) return drawn;
    }
    Fail("no effect can be seen in this set");
  }

  static Json Describe(const DrawnEffect& drawn, const Sensor& camera) {
    const EffectDescription& description = drawn.scaled.effect.effect->description();
    const VariantLaw* variant = FindVariant(drawn.scaled.effect.effect);
    Json json;
    json["effect"] = description.id;
    json["stage"] = StageName(description.stage);
    json["name"] = description.summary;
    Json parameters = Json::object();
    for (size_t k = 0; k < description.parameters.size(); ++k) {
      parameters[std::string(description.parameters[k].name)] = drawn.scaled.effect.parameters[k];
    }
    json["parameters"] = parameters;
    json["gain_target"] = drawn.target;
    if (drawn.scaled.gain_known) {
      json["gain_expected"] = drawn.scaled.gain;
    } else {
      json["gain_expected"] = "unknown";
    }
    json["gain_level"] =
        drawn.scaled.gain_known ? GainLevel(drawn.scaled.gain) : GainLevel(drawn.target);
    json["gain_reached"] = drawn.scaled.reached;
    json["redrawn"] = drawn.redrawn;
    if (variant != nullptr) {
      json["regions"] = variant->regions;
      json["depends_on"] = variant->depends_on;
    }
    const OutsideLaw* outside = FindOutsideLaw(description.id);
    if (outside != nullptr) {
      json["regions"] = description.signature.regions;
      json["depends_on"] = description.signature.depends_on;
      json["point"] = outside->point;
    }
    std::vector<std::string> accepted = {
        variant != nullptr || outside != nullptr ? "unknown" : std::string(description.id)};
    for (const std::string& id : PhysicallyEquivalent(drawn.scaled.effect, camera)) {
      accepted.push_back(id);
    }
    json["accepted"] = accepted;
    return json;
  }

  // Nothing is recorded yet: what the nominal null model expects, without speckle and noise, stands
  // in where the statistics look at the images to choose what they compare.
  static RecordedSet Planned(const RecordingSet& set) {
    std::vector<Image<uint16_t>> expected_dn;
    for (size_t i = 0; i < set.recordings.size(); ++i) {
      FrameSetup frame = PlateFrame(set, static_cast<int>(i), {});
      Image<uint16_t> image(frame.roi.columns_px, frame.roi.rows_px);
      frame.roi.column_px += frame.roi.columns_px / 2;
      frame.roi.columns_px = 2;
      const ExpectedFrame expected = ExpectFrame(frame, {}, nullptr, nullptr, 4);
      for (int row = 0; row < image.rows_px; ++row) {
        for (int column = 0; column < image.columns_px; ++column) {
          image.At(row, column) =
              static_cast<uint16_t>(std::lround(expected.MeanDn(row, column % 2)));
        }
      }
      expected_dn.push_back(std::move(image));
    }
    return MakeRecordedSet(set, std::move(expected_dn));
  }

  static Json DeviationJson(SetupDeviation deviation) {
    Json json = Json::object();
    for (int i = 0; i < kDeviations; ++i) {
      const double value = DeviationAt(deviation, i);
      const bool angle = std::string(kDeviationNames[i]).ends_with("_deg");
      json[kDeviationNames[i]] = angle ? value * 180 / std::numbers::pi : value;
    }
    json["line_position_each_px"] = deviation.line_position_each_px;
    return json;
  }

  uint64_t SeedOf(Kind kind, int index) const {
    return DeriveSeed(DeriveSeed(seed_, "concealed set", static_cast<uint64_t>(kind)), "index",
                      static_cast<uint64_t>(index));
  }

  static std::string NameOf(uint64_t own_seed) {
    return absl::StrFormat("set_%08x", static_cast<uint32_t>(DeriveSeed(own_seed, "name")));
  }

  bool IsWanted(Kind kind, int index) const {
    const std::vector<std::string>& only = options_.only;
    return only.empty() ||
           std::find(only.begin(), only.end(), NameOf(SeedOf(kind, index))) != only.end();
  }

  Json Make(Kind kind, int index) {
    const uint64_t own = SeedOf(kind, index);
    const std::string name = NameOf(own);
    const fs::path out = options_.out;
    const fs::path folder = out / "sets" / name;
    const fs::path sealed = out / "truth" / (name + ".json");
    if (std::ifstream file(sealed); file && fs::exists(folder / "recordings.json")) {
      return Json::parse(file);  // made before
    }
    const bool small = options_.small || (kind == Kind::kNull && options_.small_nulls);
    const RecordingSet set = DrawRig(own, name, small ? SetSize::kSmall : SetSize::kFull);
    const v1::Recordings message = RecordingsToProto(set);
    if (const auto parsed = ParseRecordings(message, name); !parsed.ok()) {
      Fail(parsed.status().ToString());
    }

    Json truth;
    truth["set"] = name;
    truth["seed"] = own;
    truth["is_null"] = kind == Kind::kNull;
    truth["kind"] = KindName(kind);
    truth["small"] = small;
    truth["effects"] = Json::array();
    std::vector<ActiveEffect> effects;
    const RecordedSet planned = Planned(set);
    const SetupDeviation deviation = DrawDeviation(set.uncertainty, own);
    SetPower power(planned, deviation, options_.threads);
    CounterRandom random(DeriveSeed(own, "effects"), 0);
    if (kind != Kind::kNull) {
      const std::vector<const Effect*> vocabulary = VocabularyEffects();
      const std::vector<const Effect*>& from = kind == Kind::kVariant   ? variants_
                                               : kind == Kind::kOutside ? outside_
                                               : kind == Kind::kSealed  ? sealed_
                                                                        : vocabulary;
      const bool strong = IsStrong(kind);
      const uint64_t order = DeriveSeed(seed_, KindName(kind));
      std::vector<DrawnEffect> drawn;
      drawn.push_back(
          DrawEffect(power, set, from, InTurn(from, order, index), random, nullptr, strong));
      if (IsPair(kind)) {
        const Effect* second =
            from[std::min(from.size() - 1, static_cast<size_t>(static_cast<double>(from.size()) *
                                                               random.Uniform()))];
        drawn.push_back(
            DrawEffect(power, set, from, second, random, drawn[0].scaled.effect.effect, strong));
      }
      for (const DrawnEffect& one : drawn) {
        effects.push_back(one.scaled.effect);
        truth["effects"].push_back(Describe(one, set.camera));
      }
      if (IsPair(kind)) {
        if (const absl::Status status = OrderEffects(&effects); !status.ok()) {
          Fail(status.ToString());
        }
        truth["gain_together"] = power.Gain()(effects);
      }
    }
    PlateFrameOptions frame_options;
    frame_options.deviation = deviation;
    frame_options.seed = own;
    truth["nuisance"] = DeviationJson(frame_options.deviation);
    Render(set, effects, frame_options, folder);
    std::ofstream(folder / "recordings.json") << RecordingsToJson(message) << "\n";
    WriteJson(sealed, truth);
    return truth;
  }

  void Render(const RecordingSet& set, const std::vector<ActiveEffect>& effects,
              const PlateFrameOptions& frame_options, const fs::path& folder) const {
    fs::create_directories(folder / "images");
    Image<double> previous;
    for (int i = 0; i < static_cast<int>(set.recordings.size()); ++i) {
      const FrameSetup frame = PlateFrame(set, i, frame_options);
      auto image = RenderPlateFrame(
          frame, effects, frame.burst_frame_index > 0 ? &previous : nullptr, options_.threads);
      if (!image.ok()) Fail(image.status().ToString());
      const absl::Status status =
          WriteRawImage((folder / set.recordings[i].file).string(), image->raw_dn,
                        "laser line on a plate", ImageFormat::kPng);
      if (!status.ok()) Fail(status.ToString());
      previous = std::move(image->mean_photo_electrons);
    }
  }

  const Options& options_;
  const uint64_t seed_;
  std::vector<const Effect*> variants_, outside_, sealed_;
};

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Concealed sets: recordings with effects that only truth/ tells");
  sightline::bench::Options options;
  app.add_option("OUT", options.out, "folder; what is there already is kept")->required();
  app.add_option("--seed", options.seed);
  app.add_option("--nulls", options.nulls)->check(CLI::NonNegativeNumber);
  app.add_option("--single", options.single)->check(CLI::NonNegativeNumber);
  app.add_option("--pairs", options.pairs)->check(CLI::NonNegativeNumber);
  app.add_option("--variants", options.variants)->check(CLI::NonNegativeNumber);
  app.add_option("--strong", options.strong, "effects of the vocabulary with --strong-gains")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--strong-pairs", options.strong_pairs)->check(CLI::NonNegativeNumber);
  app.add_option("--outside", options.outside, "laws outside the vocabulary, for development")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--sealed", options.sealed, "sealed laws; they serve once, after development")
      ->check(CLI::NonNegativeNumber);
  app.add_flag("--open-sealed-laws", options.open_sealed_laws, "--sealed needs it");
  app.add_flag("--small", options.small, "all sets: 13 recordings of 192 x 160");
  app.add_option("--strong-gains", options.strong_gains, "default 1000 10000, least first")
      ->check(CLI::PositiveNumber);
  app.add_flag("--small-nulls", options.small_nulls, "nulls of 13 recordings of 192 x 160");
  app.add_option("--gains", options.gains, "expected gains to draw from; default 5 20 100")
      ->check(CLI::PositiveNumber);
  app.add_option("--only", options.only, "of these sets, those that have these names");
  app.add_option("--threads", options.threads)->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  if (options.sealed > 0 && !options.open_sealed_laws) {
    sightline::bench::Fail(
        "--sealed: these laws serve once, after work on the diagnosis has ended. "
        "Add --open-sealed-laws to open them");
  }
  sightline::bench::Maker(options).Run();
  return 0;
}
