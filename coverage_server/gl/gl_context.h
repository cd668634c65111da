// SPDX-License-Identifier: Apache-2.0
// Off-screen OpenGL 3.3 core context on the CPU. OSMesa today; an EGL surfaceless context can take
// its place by providing another factory: nothing else in the tree names OSMesa.
#pragma once

#include <GL/glcorearb.h>

#include <memory>

#include "absl/status/statusor.h"

namespace sightline {

// The entry points we use, loaded per context: with OSMesa one table per context and thread.
#define SIGHTLINE_GL_FUNCTIONS(X)                              \
  X(PFNGLGETSTRINGPROC, GetString)                             \
  X(PFNGLGETERRORPROC, GetError)                               \
  X(PFNGLVIEWPORTPROC, Viewport)                               \
  X(PFNGLENABLEPROC, Enable)                                   \
  X(PFNGLDISABLEPROC, Disable)                                 \
  X(PFNGLCULLFACEPROC, CullFace)                               \
  X(PFNGLDEPTHFUNCPROC, DepthFunc)                             \
  X(PFNGLDEPTHMASKPROC, DepthMask)                             \
  X(PFNGLCOLORMASKPROC, ColorMask)                             \
  X(PFNGLBLENDFUNCPROC, BlendFunc)                             \
  X(PFNGLLINEWIDTHPROC, LineWidth)                             \
  X(PFNGLCLEARPROC, Clear)                                     \
  X(PFNGLCLEARCOLORPROC, ClearColor)                           \
  X(PFNGLCLEARDEPTHPROC, ClearDepth)                           \
  X(PFNGLDRAWBUFFERPROC, DrawBuffer)                           \
  X(PFNGLREADBUFFERPROC, ReadBuffer)                           \
  X(PFNGLPIXELSTOREIPROC, PixelStorei)                         \
  X(PFNGLREADPIXELSPROC, ReadPixels)                           \
  X(PFNGLSCISSORPROC, Scissor)                                 \
  X(PFNGLFINISHPROC, Finish)                                   \
  X(PFNGLGENFRAMEBUFFERSPROC, GenFramebuffers)                 \
  X(PFNGLDELETEFRAMEBUFFERSPROC, DeleteFramebuffers)           \
  X(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)                 \
  X(PFNGLFRAMEBUFFERRENDERBUFFERPROC, FramebufferRenderbuffer) \
  X(PFNGLCHECKFRAMEBUFFERSTATUSPROC, CheckFramebufferStatus)   \
  X(PFNGLGENRENDERBUFFERSPROC, GenRenderbuffers)               \
  X(PFNGLDELETERENDERBUFFERSPROC, DeleteRenderbuffers)         \
  X(PFNGLBINDRENDERBUFFERPROC, BindRenderbuffer)               \
  X(PFNGLRENDERBUFFERSTORAGEPROC, RenderbufferStorage)         \
  X(PFNGLGENVERTEXARRAYSPROC, GenVertexArrays)                 \
  X(PFNGLDELETEVERTEXARRAYSPROC, DeleteVertexArrays)           \
  X(PFNGLBINDVERTEXARRAYPROC, BindVertexArray)                 \
  X(PFNGLGENBUFFERSPROC, GenBuffers)                           \
  X(PFNGLDELETEBUFFERSPROC, DeleteBuffers)                     \
  X(PFNGLBINDBUFFERPROC, BindBuffer)                           \
  X(PFNGLBUFFERDATAPROC, BufferData)                           \
  X(PFNGLVERTEXATTRIBPOINTERPROC, VertexAttribPointer)         \
  X(PFNGLENABLEVERTEXATTRIBARRAYPROC, EnableVertexAttribArray) \
  X(PFNGLCREATESHADERPROC, CreateShader)                       \
  X(PFNGLSHADERSOURCEPROC, ShaderSource)                       \
  X(PFNGLCOMPILESHADERPROC, CompileShader)                     \
  X(PFNGLGETSHADERIVPROC, GetShaderiv)                         \
  X(PFNGLGETSHADERINFOLOGPROC, GetShaderInfoLog)               \
  X(PFNGLDELETESHADERPROC, DeleteShader)                       \
  X(PFNGLCREATEPROGRAMPROC, CreateProgram)                     \
  X(PFNGLATTACHSHADERPROC, AttachShader)                       \
  X(PFNGLLINKPROGRAMPROC, LinkProgram)                         \
  X(PFNGLGETPROGRAMIVPROC, GetProgramiv)                       \
  X(PFNGLGETPROGRAMINFOLOGPROC, GetProgramInfoLog)             \
  X(PFNGLDELETEPROGRAMPROC, DeleteProgram)                     \
  X(PFNGLUSEPROGRAMPROC, UseProgram)                           \
  X(PFNGLGETUNIFORMLOCATIONPROC, GetUniformLocation)           \
  X(PFNGLUNIFORMMATRIX4FVPROC, UniformMatrix4fv)               \
  X(PFNGLUNIFORM1FPROC, Uniform1f)                             \
  X(PFNGLUNIFORM1IPROC, Uniform1i)                             \
  X(PFNGLUNIFORM3FPROC, Uniform3f)                             \
  X(PFNGLUNIFORM4FPROC, Uniform4f)                             \
  X(PFNGLDRAWARRAYSPROC, DrawArrays)                           \
  X(PFNGLDRAWELEMENTSPROC, DrawElements)

struct GlFunctions {
#define X(type, name) type name = nullptr;
  SIGHTLINE_GL_FUNCTIONS(X)
#undef X
};

// Owns a context that is current on the thread that made it; use and destroy it there.
class GlContext {
 public:
  virtual ~GlContext() = default;
  const GlFunctions& gl() const { return gl_; }

 protected:
  GlFunctions gl_;
};

// INTERNAL if the context cannot be made or lacks an entry point.
absl::StatusOr<std::unique_ptr<GlContext>> MakeOffscreenContext();

// Off-screen target with 32-bit float depth and, if asked, RGBA8 colour; bound on creation.
class Framebuffer {
 public:
  // INTERNAL if the driver refuses the format or size.
  static absl::StatusOr<std::unique_ptr<Framebuffer>> Make(const GlFunctions& gl, int columns,
                                                           int rows, bool with_colour);
  ~Framebuffer();
  Framebuffer(const Framebuffer&) = delete;
  Framebuffer& operator=(const Framebuffer&) = delete;
  void Bind() const;

 private:
  explicit Framebuffer(const GlFunctions& gl) : gl_(gl) {}
  const GlFunctions& gl_;
  GLuint framebuffer_ = 0;
  GLuint renderbuffers_[2] = {0, 0};
};

// Compiles and links; INTERNAL with the driver's log.
absl::StatusOr<GLuint> MakeProgram(const GlFunctions& gl, const char* vertex_source,
                                   const char* fragment_source);

}  // namespace sightline
