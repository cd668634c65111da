// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/lamps/path_tracer.h"

#include <algorithm>
#include <type_traits>

namespace sightline {
namespace {

using Spectral = Eigen::Array<float, kSpectralBins, 1>;

template <class Value>
Value Reflectance(const SurfacePoint& point, const Eigen::Vector3f& out,
                  const Eigen::Vector3f& in) {
  if constexpr (std::is_same_v<Value, float>) {
    return point.material->Brdf(out, in, point.detail);
  } else {
    if (point.material->grey()) {
      return Value::Constant(point.material->Brdf(out, in, point.detail));
    }
    Spectrum brdf;
    point.material->BrdfSpectrum(out, in, point.detail, brdf);
    return Eigen::Map<const Spectral>(brdf.data());
  }
}

// Weight of the first of two ways to take a sample (Veach 1997, exponent 2).
float PowerHeuristic(float pdf, float other) { return 1 / (1 + (other / pdf) * (other / pdf)); }

// Earlier it costs more in noise than it saves in rays (bench/cycles).
constexpr int kFirstRoulette = 4;

float Largest(float value) { return value; }
float Largest(const Spectral& value) { return value.maxCoeff(); }

}  // namespace

PathTracer::PathTracer(const RayScene& scene, const std::vector<Spectrum>& channel_weights,
                       int max_bounces)
    : scene_(scene),
      lamps_(scene.description()),
      channels_(static_cast<int>(channel_weights.size())),
      max_bounces_(max_bounces),
      weights_(channel_weights) {
  for (const auto& lamp : scene.description().area_lights) {
    // A lamp contributes its radiance minus the ambient radiance. Ambient light then comes from all
    // directions, also along rays that meet a lamp.
    sources_.push_back(lamp.radiance_w_m2_sr);
    for (int b = 0; b < kSpectralBins; ++b) {
      sources_.back()[b] -= scene.description().ambient_radiance_w_m2_sr[b];
    }
  }
  sources_.push_back(scene.description().ambient_radiance_w_m2_sr);
  for (const Spectrum& source : sources_) {
    for (const Spectrum& weight : weights_) {
      double sum = 0;
      for (int b = 0; b < kSpectralBins; ++b) sum += double{source[b]} * weight[b];
      channel_radiance_.push_back(static_cast<float>(sum));
    }
  }
}

template <class Value>
class PathTracer::Sum {
 public:
  Sum(const PathTracer& tracer, std::span<float> sums) : tracer_(tracer), sums_(sums) {
    if constexpr (!kGrey) light_.setZero();
  }
  void Add(int source, const Value& factor) {
    const int channels = tracer_.channels_;
    if constexpr (kGrey) {
      const float* radiance =
          tracer_.channel_radiance_.data() + static_cast<size_t>(source) * channels;
      for (int c = 0; c < channels; ++c) sums_[c] += factor * radiance[c];
    } else {
      light_ += factor * Eigen::Map<const Spectral>(tracer_.sources_[source].data());
      dark_ = false;
    }
  }
  void Finish() {
    if constexpr (!kGrey) {
      if (dark_) return;
      for (int c = 0; c < tracer_.channels_; ++c) {
        sums_[c] += (light_ * Eigen::Map<const Spectral>(tracer_.weights_[c].data())).sum();
      }
    }
  }

 private:
  static constexpr bool kGrey = std::is_same_v<Value, float>;
  const PathTracer& tracer_;
  std::span<float> sums_;
  bool dark_ = true;
  [[maybe_unused]] Spectral light_;
};

int PathTracer::AddDirect(const SurfacePoint* first, const Eigen::Vector3f& direction,
                          PixelSamples& samples, std::span<float> sums) const {
  return scene_.grey() ? Direct<float>(first, direction, samples, sums)
                       : Direct<Spectral>(first, direction, samples, sums);
}

int PathTracer::AddReflected(const SurfacePoint& first, const Eigen::Vector3f& direction,
                             PixelSamples& samples, std::span<float> sums,
                             float& inverse_distance_1_m) const {
  return scene_.grey() ? Reflected<float>(first, direction, samples, sums, inverse_distance_1_m)
                       : Reflected<Spectral>(first, direction, samples, sums, inverse_distance_1_m);
}

template <class Value>
int PathTracer::Direct(const SurfacePoint* first, const Eigen::Vector3f& direction,
                       PixelSamples& samples, std::span<float> sums) const {
  Sum<Value> light(*this, sums);
  const auto constant = [](float value) {
    if constexpr (std::is_same_v<Value, float>) {
      return value;
    } else {
      return Value(Value::Constant(value));
    }
  };
  int rays = 0;
  if (first == nullptr) {
    light.Add(static_cast<int>(sources_.size()) - 1, constant(1));
  } else if (first->lamp >= 0) {
    if (first->front) {
      light.Add(first->lamp, constant(1));
      light.Add(static_cast<int>(sources_.size()) - 1, constant(1));
    }
  } else if (!lamps_.empty()) {
    const SurfacePoint& point = *first;
    const Eigen::Vector3f out = point.ToLocal(-direction.normalized());
    const auto u = samples.Next();
    const LampChoice::Sample lamp = lamps_.SampleLamp(point, u[0], u[1], u[2]);
    const Eigen::Vector3f in = point.ToLocal(lamp.direction);
    if (lamp.lamp >= 0 && in.z() > 0) {
      ++rays;
      if (scene_.Visible(point, lamp.point_m)) {
        const float weight = PowerHeuristic(lamp.pdf, point.material->Pdf(out, in, point.detail));
        light.Add(lamp.lamp,
                  Value(Reflectance<Value>(point, out, in) * (weight * in.z() / lamp.pdf)));
      }
    }
    // A direction sampled from the BRDF needs a ray only if it meets a lamp.
    const auto v = samples.Next();
    const Material::Sample sample =
        point.material->SampleDirection(out, point.detail, v[0], v[1], v[2]);
    if (sample.pdf > 0 && sample.in.z() > 0) {
      Eigen::Vector3f place;
      const int met = lamps_.Meet(point.position_m, point.ToWorld(sample.in), place);
      if (met >= 0) {
        ++rays;
        if (scene_.Visible(point, place)) {
          const float weight = PowerHeuristic(sample.pdf, lamps_.Pdf(point, met));
          light.Add(met, Value(Reflectance<Value>(point, out, sample.in) *
                               (weight * sample.in.z() / sample.pdf)));
        }
      }
    }
  }
  light.Finish();
  return rays;
}

template <class Value>
int PathTracer::Reflected(const SurfacePoint& first, const Eigen::Vector3f& direction,
                          PixelSamples& samples, std::span<float> sums,
                          float& inverse_distance_1_m) const {
  Sum<Value> light(*this, sums);
  Value throughput;
  if constexpr (std::is_same_v<Value, float>) {
    throughput = 1;
  } else {
    throughput.setOnes();
  }
  int rays = 0;
  SurfacePoint point = first, next;
  Eigen::Vector3f towards = direction.normalized();
  for (int bounce = 0;; ++bounce) {
    const Eigen::Vector3f out = point.ToLocal(-towards);
    if (bounce > 0 && !lamps_.empty()) {
      const auto u = samples.Next();
      const LampChoice::Sample lamp = lamps_.SampleLamp(point, u[0], u[1], u[2]);
      const Eigen::Vector3f in = point.ToLocal(lamp.direction);
      if (lamp.lamp >= 0 && in.z() > 0) {
        ++rays;
        if (scene_.Visible(point, lamp.point_m)) {
          const float weight = PowerHeuristic(lamp.pdf, point.material->Pdf(out, in, point.detail));
          light.Add(lamp.lamp, Value(throughput * Reflectance<Value>(point, out, in) *
                                     (weight * in.z() / lamp.pdf)));
        }
      }
    }
    const auto u = samples.Next();
    const Material::Sample sample =
        point.material->SampleDirection(out, point.detail, u[0], u[1], u[2]);
    if (!(sample.pdf > 0) || sample.in.z() <= 0) break;
    throughput *= Reflectance<Value>(point, out, sample.in) * (sample.in.z() / sample.pdf);
    const float largest = Largest(throughput);
    if (!(largest > 0)) break;
    if (bounce >= kFirstRoulette) {
      // Russian roulette keeps the expectation.
      const float survival = std::min(1.0F, largest * 2);
      if (u[3] >= survival) break;
      throughput *= 1 / survival;
    }
    towards = point.ToWorld(sample.in);
    ++rays;
    if (!scene_.IntersectFrom(point, towards, next)) {
      light.Add(static_cast<int>(sources_.size()) - 1, throughput);
      break;
    }
    if (bounce == 0) inverse_distance_1_m = 1 / next.distance;
    if (next.lamp >= 0) {
      if (next.front) light.Add(static_cast<int>(sources_.size()) - 1, throughput);
      if (next.front && bounce > 0) {
        light.Add(next.lamp,
                  Value(throughput * PowerHeuristic(sample.pdf, lamps_.Pdf(point, next.lamp))));
      }
      break;
    }
    if (bounce >= max_bounces_) break;
    point = next;
  }
  light.Finish();
  return rays;
}

}  // namespace sightline
