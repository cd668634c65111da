#include "render_worker/light_transport/path_tracer.h"

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
    sources_.push_back(lamp.radiance_w_m2_sr);
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

int PathTracer::AddLight(const SurfacePoint* first, const Eigen::Vector3f& direction,
                         PixelSamples& samples, std::span<float> sums,
                         FirstReflection& reflection) const {
  return scene_.grey() ? Trace<float>(first, direction, samples, sums, reflection)
                       : Trace<Spectral>(first, direction, samples, sums, reflection);
}

template <class Value>
int PathTracer::Trace(const SurfacePoint* first, const Eigen::Vector3f& direction,
                      PixelSamples& samples, std::span<float> sums,
                      FirstReflection& reflection) const {
  constexpr bool kGrey = std::is_same_v<Value, float>;
  const int ambient = static_cast<int>(sources_.size()) - 1;
  Value throughput;
  [[maybe_unused]] Spectral light[2];  // straight from lamps, the rest
  if constexpr (kGrey) {
    throughput = 1;
  } else {
    throughput.setOnes();
    light[0].setZero();
    light[1].setZero();
  }
  const auto add = [&](int part, int source, const Value& factor) {
    if constexpr (kGrey) {
      const float* radiance = channel_radiance_.data() + static_cast<size_t>(source) * channels_;
      float* sum = sums.data() + static_cast<size_t>(part) * channels_;
      for (int c = 0; c < channels_; ++c) sum[c] += factor * radiance[c];
    } else {
      light[part] += factor * Eigen::Map<const Spectral>(sources_[source].data());
    }
  };

  int rays = 0;
  SurfacePoint point, next;
  Eigen::Vector3f towards = direction.normalized();
  if (first == nullptr) {
    add(0, ambient, throughput);
  } else if (first->lamp >= 0) {
    if (first->front) add(0, first->lamp, throughput);
  } else {
    point = *first;
    for (int bounce = 0;; ++bounce) {
      const Eigen::Vector3f out = point.ToLocal(-towards);
      if (!lamps_.empty()) {
        const auto u = samples.Next();
        const LampChoice::Sample lamp = lamps_.SampleLamp(point, u[0], u[1], u[2]);
        const Eigen::Vector3f in = point.ToLocal(lamp.direction);
        if (lamp.lamp >= 0 && in.z() > 0) {
          const Value f = Reflectance<Value>(point, out, in);
          if (Largest(f) > 0) {
            ++rays;
            if (scene_.Visible(point, lamp.point_m)) {
              const float weight =
                  PowerHeuristic(lamp.pdf, point.material->Pdf(out, in, point.detail));
              add(bounce > 0, lamp.lamp, Value(throughput * f * (weight * in.z() / lamp.pdf)));
            }
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
      if (bounce >= 2) {
        // Russian roulette keeps the expectation.
        const float survival = std::min(1.0F, largest * 2);
        if (u[3] >= survival) break;
        throughput *= 1 / survival;
      }
      towards = point.ToWorld(sample.in);
      ++rays;
      if (!scene_.IntersectFrom(point, towards, next)) {
        add(1, ambient, throughput);
        break;
      }
      if (bounce == 0) reflection.inverse_distance_1_m = 1 / next.distance;
      if (next.lamp >= 0) {
        if (next.front) {
          const float lamp_pdf = lamps_.Pdf(point, next.lamp);
          add(bounce > 0, next.lamp, Value(throughput * PowerHeuristic(sample.pdf, lamp_pdf)));
        }
        break;
      }
      if (bounce >= max_bounces_) break;
      point = next;
    }
  }
  if constexpr (!kGrey) {
    for (int c = 0; c < channels_; ++c) {
      for (int part = 0; part < 2; ++part) {
        sums[part * channels_ + c] +=
            (light[part] * Eigen::Map<const Spectral>(weights_[c].data())).sum();
      }
    }
  }
  return rays;
}

}  // namespace sightline
