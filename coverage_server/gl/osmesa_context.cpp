// SPDX-License-Identifier: Apache-2.0
// clang-format off
// Must be included first: glcorearb.h omits types if gl.h (through osmesa.h) was included before.
#include "coverage_server/gl/gl_context.h"

#include <GL/osmesa.h>
// clang-format on

#include <array>
#include <cstdint>
#include <cstdlib>
#include <mutex>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

class OsMesaContext final : public GlContext {
 public:
  ~OsMesaContext() override {
    if (context_ != nullptr) OSMesaDestroyContext(context_);
  }

  absl::Status Init() {
    // Only our threads, none of llvmpipe; it reads this before the first context.
    static std::once_flag once;
    std::call_once(once, [] { setenv("LP_NUM_THREADS", "0", 0); });

    const std::array<int, 13> attributes = {OSMESA_FORMAT,
                                            OSMESA_RGBA,
                                            OSMESA_DEPTH_BITS,
                                            24,
                                            OSMESA_PROFILE,
                                            OSMESA_CORE_PROFILE,
                                            OSMESA_CONTEXT_MAJOR_VERSION,
                                            3,
                                            OSMESA_CONTEXT_MINOR_VERSION,
                                            3,
                                            0,
                                            0,
                                            0};
    context_ = OSMesaCreateContextAttribs(attributes.data(), nullptr);
    if (context_ == nullptr) return absl::InternalError("OSMesa cannot make a 3.3 core context");
    // We draw only into framebuffer objects, but OSMesa requires a colour buffer.
    if (!OSMesaMakeCurrent(context_, dummy_.data(), GL_UNSIGNED_BYTE, 4, 4)) {
      return absl::InternalError("OSMesa cannot make its context current");
    }
#define X(type, name)                                                  \
  gl_.name = reinterpret_cast<type>(OSMesaGetProcAddress("gl" #name)); \
  if (gl_.name == nullptr) return absl::InternalError("OSMesa lacks gl" #name);
    SIGHTLINE_GL_FUNCTIONS(X)
#undef X
    return absl::OkStatus();
  }

 private:
  OSMesaContext context_ = nullptr;
  std::array<uint8_t, size_t{4} * 4 * 4> dummy_{};
};

}  // namespace

absl::StatusOr<std::unique_ptr<GlContext>> MakeOffscreenContext() {
  auto context = std::make_unique<OsMesaContext>();
  SIGHTLINE_RETURN_IF_ERROR(context->Init());
  return context;
}

absl::StatusOr<std::unique_ptr<Framebuffer>> Framebuffer::Make(const GlFunctions& gl, int columns,
                                                               int rows, bool with_colour) {
  std::unique_ptr<Framebuffer> framebuffer(new Framebuffer(gl));
  gl.GenFramebuffers(1, &framebuffer->framebuffer_);
  gl.GenRenderbuffers(2, framebuffer->renderbuffers_);
  gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer->framebuffer_);
  gl.BindRenderbuffer(GL_RENDERBUFFER, framebuffer->renderbuffers_[0]);
  gl.RenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT32F, columns, rows);
  gl.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER,
                             framebuffer->renderbuffers_[0]);
  if (with_colour) {
    gl.BindRenderbuffer(GL_RENDERBUFFER, framebuffer->renderbuffers_[1]);
    gl.RenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, columns, rows);
    gl.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER,
                               framebuffer->renderbuffers_[1]);
    gl.DrawBuffer(GL_COLOR_ATTACHMENT0);
    gl.ReadBuffer(GL_COLOR_ATTACHMENT0);
  } else {
    gl.DrawBuffer(GL_NONE);
    gl.ReadBuffer(GL_NONE);
  }
  const GLenum state = gl.CheckFramebufferStatus(GL_FRAMEBUFFER);
  if (state != GL_FRAMEBUFFER_COMPLETE) {
    return absl::InternalError(
        absl::StrCat("framebuffer of ", columns, "x", rows, " is incomplete: ", state));
  }
  return framebuffer;
}

Framebuffer::~Framebuffer() {
  gl_.DeleteFramebuffers(1, &framebuffer_);
  gl_.DeleteRenderbuffers(2, renderbuffers_);
}

void Framebuffer::Bind() const { gl_.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_); }

absl::StatusOr<GLuint> MakeProgram(const GlFunctions& gl, const char* vertex_source,
                                   const char* fragment_source) {
  const GLuint program = gl.CreateProgram();
  GLint ok = 0;
  std::array<char, 1024> log{};
  for (const auto& [kind, source] : {std::pair{GL_VERTEX_SHADER, vertex_source},
                                     std::pair{GL_FRAGMENT_SHADER, fragment_source}}) {
    const GLuint shader = gl.CreateShader(kind);
    gl.ShaderSource(shader, 1, &source, nullptr);
    gl.CompileShader(shader);
    gl.GetShaderiv(shader, GL_COMPILE_STATUS, &ok);
    if (!ok) {
      gl.GetShaderInfoLog(shader, log.size(), nullptr, log.data());
      return absl::InternalError(absl::StrCat("shader does not compile: ", log.data()));
    }
    gl.AttachShader(program, shader);
    gl.DeleteShader(shader);
  }
  gl.LinkProgram(program);
  gl.GetProgramiv(program, GL_LINK_STATUS, &ok);
  if (!ok) {
    gl.GetProgramInfoLog(program, log.size(), nullptr, log.data());
    return absl::InternalError(absl::StrCat("shaders do not link: ", log.data()));
  }
  return program;
}

}  // namespace sightline
