// Less work for a browser whose processor draws: it takes a microsecond for each pixel, and as much
// again for smooth edges. So the picture has fewer pixels along each side, chosen, and its edges are
// not smoothed. It does not wait for the page around it, which saves copies of it. Light is computed
// at corners in place of pixels, without the reflections that our matt machines do not have; and
// nothing is drawn behind the scene, where viser may have a picture.
{
  const gl = document.createElement("canvas").getContext("webgl2");
  const names = gl?.getExtension("WEBGL_debug_renderer_info");
  const renderer = names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  if (/swiftshader|llvmpipe|basic render/i.test(renderer)) {
    const address = new URL(location);
    address.searchParams.set("fixedDpr", "0.75");
    history.replaceState(null, "", address);
    const context = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, options) {
      return context.call(this, kind, {...options, antialias: false, desynchronized: true});
    };
    // three.js's own light, tones (ACES) and sRGB, for its material "standard"
    const declared = `
      struct DirectionalLight { vec3 direction; vec3 color; };
      uniform DirectionalLight directionalLights[2];
      uniform vec3 ambientLightColor, diffuse;
      out vec3 vSeen;
      void main() {`;
    const lit = `
      vec3 light = ambientLightColor;
      for (int k = 0; k < 2; k++)
        light += max(dot(vNormal, directionalLights[k].direction), 0.0) * directionalLights[k].color;
      vec3 v = mat3(0.59719, 0.076, 0.0284, 0.35458, 0.90834, 0.13383, 0.04823, 0.01566, 0.83777)
        * (diffuse * light / 3.14159 / 0.6);
      v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081);
      v = clamp(mat3(1.60475, -0.10208, -0.00327, -0.53108, 1.10813, -0.07276, -0.07367, -0.00605,
        1.07602) * v, 0.0, 1.0);
      vSeen = mix(1.055 * pow(v, vec3(0.41666)) - 0.055, 12.92 * v, vec3(lessThan(v, vec3(0.0031))));
    }`;
    const plain = "in vec3 vSeen; void main() { gl_FragColor = vec4(vSeen, opacity); }";
    const source = WebGL2RenderingContext.prototype.shaderSource;
    WebGL2RenderingContext.prototype.shaderSource = function (shader, text) {
      const [head, body] = text.split("void main() {");
      if (text.includes("#define STANDARD")) {
        const corners = this.getShaderParameter(shader, this.SHADER_TYPE) === this.VERTEX_SHADER;
        text = corners ? head + declared + body.slice(0, body.lastIndexOf("}")) + lit : head + plain;
      }
      const behind = /(vUv = uv;[^;]*gl_Position =) projectionMatrix[^;]*;/;
      source.call(this, shader, text.replace(behind, "$1 vec4(2.0);"));
    };
  }
}
