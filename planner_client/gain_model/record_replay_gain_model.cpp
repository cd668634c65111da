// SPDX-License-Identifier: Apache-2.0
#include "planner_client/gain_model/record_replay_gain_model.h"

#include <cstring>
#include <filesystem>
#include <optional>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"

namespace sightline {
namespace {

// A journal is not continued beyond this size; a resumed run starts again from here.
constexpr int64_t kMaxJournalBytes = int64_t{2} << 30;
// Larger than any batch of gains or coverages.
constexpr uint32_t kMaxAnswerBytes = 512 << 20;
// Signature of the file: its type, the layout of answers and the machine's byte order.
constexpr char kFileType[] = "sightline answers 2\n";

// Values one after the other, in the machine's own form.
class Writer {
 public:
  template <typename T>
  void Put(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(value));
  }
  template <typename T>
  void PutAll(std::span<const T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    Put(static_cast<uint64_t>(values.size()));
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// First 8 bytes of the SHA-256.
uint64_t Digest(const std::string& bytes) {
  Sha256 hash;
  hash.Update(bytes);
  const Sha256::Bytes digest = hash.Finish();
  uint64_t value;
  std::memcpy(&value, digest.data(), sizeof(value));
  return value;
}

enum class QueryKind : uint8_t {
  kGains = 1,
  kWeightedGains,
  kFastCoverage,
  kExactCoverage,
  kPlanScore,
  kGrowingPlanScore
};

uint64_t QueryDigest(QueryKind kind, std::span<const Measurement> measurements,
                     std::span<const float> values = {}) {
  Writer query;
  query.Put(kind);
  query.Put(static_cast<uint64_t>(measurements.size()));
  for (const Measurement& measurement : measurements) query.Put(ToArray(measurement));
  query.PutAll(values);
  return Digest(query.bytes());
}

// Reads past the end give zeros and leave it not ok().
class Reader {
 public:
  explicit Reader(const std::string& bytes) : bytes_(bytes) {}
  template <typename T>
  T Get() {
    T value{};
    if (bytes_.size() - place_ < sizeof(T)) {
      ok_ = false;
    } else {
      std::memcpy(&value, bytes_.data() + place_, sizeof(T));
      place_ += sizeof(T);
    }
    return value;
  }
  template <typename T>
  std::vector<T> GetAll() {
    const auto count = Get<uint64_t>();
    if (!ok_ || count > (bytes_.size() - place_) / sizeof(T)) {
      ok_ = false;
      return {};
    }
    std::vector<T> values(count);
    if (count > 0) std::memcpy(values.data(), bytes_.data() + place_, count * sizeof(T));
    place_ += count * sizeof(T);
    return values;
  }
  bool AtEnd() const { return ok_ && place_ == bytes_.size(); }
  bool ok() const { return ok_; }

 private:
  const std::string& bytes_;
  size_t place_ = 0;
  bool ok_ = true;
};

void Encode(const ScanGain& gain, Writer& out) {
  out.Put(gain.feasibility);
  out.Put(gain.new_targets);
  out.Put(gain.covered_targets);
  out.Put(gain.weighted_gain);
  out.Put(gain.gain);
}
void Decode(Reader& in, ScanGain* gain) {
  gain->feasibility = in.Get<ScanFeasibility>();
  gain->new_targets = in.Get<int32_t>();
  gain->covered_targets = in.Get<int32_t>();
  gain->weighted_gain = in.Get<double>();
  gain->gain = in.Get<double>();
}

void Encode(const TargetBits& bits, Writer& out) {
  out.Put(static_cast<uint64_t>(bits.size()));
  out.PutAll(std::span<const uint64_t>(bits.words()));
}
void Decode(Reader& in, TargetBits* bits) {
  const auto size = in.Get<uint64_t>();
  std::vector<uint64_t> words = in.GetAll<uint64_t>();
  if (words.size() != (size + 63) / 64) words.clear();
  *bits = TargetBits(words.empty() ? 0 : size);
  bits->words() = std::move(words);
}

void Encode(const ScanCoverage& coverage, Writer& out) {
  out.Put(coverage.feasibility);
  Encode(coverage.covered, out);
  Encode(coverage.covered_without_normal_gate, out);
  out.Put(coverage.first_frame);
  out.Put(coverage.last_frame);
  out.Put(coverage.measurement_points);
  Encode(coverage.validation_covered, out);
  out.PutAll(std::span<const uint32_t>(coverage.shares.targets));
  out.PutAll(std::span<const float>(coverage.shares.share));
}
void Decode(Reader& in, ScanCoverage* coverage) {
  coverage->feasibility = in.Get<ScanFeasibility>();
  Decode(in, &coverage->covered);
  Decode(in, &coverage->covered_without_normal_gate);
  coverage->first_frame = in.Get<int32_t>();
  coverage->last_frame = in.Get<int32_t>();
  coverage->measurement_points = in.Get<int64_t>();
  Decode(in, &coverage->validation_covered);
  coverage->shares.targets = in.GetAll<uint32_t>();
  coverage->shares.share = in.GetAll<float>();
}

void Encode(const std::optional<int64_t>& value, Writer& out) {
  out.Put(static_cast<uint8_t>(value.has_value()));
  out.Put(value.value_or(0));
}
void Decode(Reader& in, std::optional<int64_t>* value) {
  const bool given = in.Get<uint8_t>() != 0;
  const auto number = in.Get<int64_t>();
  *value = given ? std::optional<int64_t>(number) : std::nullopt;
}

void Encode(const PlanScore& score, Writer& out) {
  out.Put(score.satisfied);
  out.Put(score.relaxed);
  out.Put(score.measurable);
  Encode(score.validation_satisfied, out);
  Encode(score.validation_relaxed, out);
  out.Put(score.validation_measurable);
}
void Decode(Reader& in, PlanScore* score) {
  score->satisfied = in.Get<int64_t>();
  score->relaxed = in.Get<int64_t>();
  score->measurable = in.Get<int64_t>();
  Decode(in, &score->validation_satisfied);
  Decode(in, &score->validation_relaxed);
  score->validation_measurable = in.Get<int64_t>();
}

template <typename T>
void Encode(const std::vector<T>& values, Writer& out) {
  out.Put(static_cast<uint64_t>(values.size()));
  for (const T& value : values) Encode(value, out);
}
template <typename T>
void Decode(Reader& in, std::vector<T>* values) {
  const auto count = in.Get<uint64_t>();
  for (uint64_t i = 0; i < count && in.ok(); ++i) Decode(in, &values->emplace_back());
}

// Before every answer in the file.
struct AnswerHeader {
  uint64_t query = 0;
  uint64_t check = 0;  // of the answer's bytes
  uint32_t size_bytes = 0;
  uint32_t reserved = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<RecordReplayGainModel>> RecordReplayGainModel::Open(
    std::unique_ptr<GainModel> gain_model, const std::string& file, const std::string& fingerprint,
    Remark remark) {
  auto journal = std::unique_ptr<RecordReplayGainModel>(
      new RecordReplayGainModel(std::move(gain_model), file, std::move(remark)));
  const std::string start = absl::StrCat(kFileType, fingerprint, "\n");
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  if (!error && size > start.size()) {
    journal->replay_.open(file, std::ios::binary);
    std::string found(start.size(), '\0');
    journal->replay_.read(found.data(), static_cast<std::streamsize>(found.size()));
    journal->replaying_ = journal->replay_ && found == start;
    if (!journal->replaying_ && journal->remark_) {
      journal->remark_(absl::StrCat(
          file,
          found.starts_with(kFileType)
              ? ": its answers belong to another task (a file, an option or the program changed)"
              : ": is damaged, or of another version",
          "; all are evaluated again"));
    }
  }
  if (journal->replaying_) {
    journal->size_bytes_ = static_cast<int64_t>(start.size());
    journal->replay_end_ = static_cast<int64_t>(size);
    return journal;
  }
  journal->replay_.close();
  journal->append_.open(file, std::ios::binary | std::ios::trunc);
  journal->append_ << start << std::flush;
  if (!journal->append_) {
    return absl::InternalError(absl::StrCat(file, ": cannot be written"));
  }
  journal->size_bytes_ = static_cast<int64_t>(start.size());
  return journal;
}

void RecordReplayGainModel::EndReplay(const std::string& why) {
  replaying_ = false;
  replay_.close();
  if (remark_ && !why.empty()) {
    remark_(absl::StrCat(file_, ": answer ", replayed_queries_ + 1, " ", why,
                         "; it and the later ones are evaluated again"));
  }
  std::error_code error;
  std::filesystem::resize_file(file_, static_cast<uintmax_t>(size_bytes_), error);
  append_.open(file_, std::ios::binary | std::ios::app);
}

bool RecordReplayGainModel::NextAnswer(uint64_t query, std::string* answer) {
  if (!replaying_) return false;
  if (size_bytes_ == replay_end_) {
    EndReplay("");
    return false;
  }
  AnswerHeader header;
  replay_.read(reinterpret_cast<char*>(&header), sizeof(header));
  const int64_t left = replay_end_ - size_bytes_ - static_cast<int64_t>(sizeof(header));
  bool whole = replay_ && header.size_bytes <= kMaxAnswerBytes && header.size_bytes <= left;
  if (whole) {
    answer->resize(header.size_bytes);
    replay_.read(answer->data(), static_cast<std::streamsize>(answer->size()));
    whole = replay_ && Digest(*answer) == header.check;
  }
  if (!whole || header.query != query) {
    EndReplay(whole ? "is to another query" : "is damaged or was not written whole");
    return false;
  }
  return true;
}

void RecordReplayGainModel::Append(uint64_t query, const std::string& answer) {
  // A full disk loses the journal, not the plan.
  if (!append_ || size_bytes_ > kMaxJournalBytes || answer.size() > kMaxAnswerBytes) return;
  const AnswerHeader header{query, Digest(answer), static_cast<uint32_t>(answer.size()), 0};
  append_.write(reinterpret_cast<const char*>(&header), sizeof(header));
  append_.write(answer.data(), static_cast<std::streamsize>(answer.size()));
  append_.flush();
  size_bytes_ += static_cast<int64_t>(sizeof(header) + answer.size());
}

template <typename Answer>
absl::StatusOr<Answer> RecordReplayGainModel::AnswerTo(
    uint64_t query, const std::function<absl::StatusOr<Answer>()>& ask) {
  std::string bytes;
  if (NextAnswer(query, &bytes)) {
    Reader in(bytes);
    const auto counted = in.Get<int64_t>();
    Answer answer;
    Decode(in, &answer);
    if (in.AtEnd() && counted >= 0) {
      size_bytes_ += static_cast<int64_t>(sizeof(AnswerHeader) + bytes.size());
      ++replayed_queries_;
      evaluations_ += counted;
      return answer;
    }
    EndReplay("is damaged");
  }
  const int64_t before = gain_model_->evaluations();
  absl::StatusOr<Answer> answer = ask();
  const int64_t counted = gain_model_->evaluations() - before;
  evaluations_ += counted;
  if (!answer.ok()) return answer;
  Writer out;
  out.Put(counted);
  Encode(*answer, out);
  Append(query, out.bytes());
  return answer;
}

absl::StatusOr<std::vector<ScanGain>> RecordReplayGainModel::Gains(
    std::span<const Measurement> measurements, std::span<const float> known) {
  return AnswerTo<std::vector<ScanGain>>(QueryDigest(QueryKind::kGains, measurements, known),
                                         [&] { return gain_model_->Gains(measurements, known); });
}

absl::StatusOr<std::vector<ScanGain>> RecordReplayGainModel::WeightedGains(
    std::span<const Measurement> measurements, std::span<const float> weights) {
  return AnswerTo<std::vector<ScanGain>>(
      QueryDigest(QueryKind::kWeightedGains, measurements, weights),
      [&] { return gain_model_->WeightedGains(measurements, weights); });
}

absl::StatusOr<std::vector<ScanCoverage>> RecordReplayGainModel::FastCoverage(
    std::span<const Measurement> measurements) {
  return AnswerTo<std::vector<ScanCoverage>>(
      QueryDigest(QueryKind::kFastCoverage, measurements),
      [&] { return gain_model_->FastCoverage(measurements); });
}

absl::StatusOr<std::vector<ScanCoverage>> RecordReplayGainModel::ExactCoverage(
    std::span<const Measurement> measurements) {
  return AnswerTo<std::vector<ScanCoverage>>(
      QueryDigest(QueryKind::kExactCoverage, measurements),
      [&] { return gain_model_->ExactCoverage(measurements); });
}

absl::StatusOr<PlanScore> RecordReplayGainModel::ScorePlan(std::span<const Measurement> scans,
                                                           bool thorough) {
  const float flag = thorough ? 1.0f : 0.0f;
  return AnswerTo<PlanScore>(
      QueryDigest(QueryKind::kPlanScore, scans, std::span<const float>(&flag, 1)),
      [&] { return gain_model_->ScorePlan(scans, thorough); });
}

absl::StatusOr<std::vector<PlanScore>> RecordReplayGainModel::ScoreGrowingPlan(
    std::span<const Measurement> scans) {
  return AnswerTo<std::vector<PlanScore>>(QueryDigest(QueryKind::kGrowingPlanScore, scans),
                                          [&] { return gain_model_->ScoreGrowingPlan(scans); });
}

}  // namespace sightline
