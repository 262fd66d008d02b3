within WheelsetRig.Parts;
model FixedTranslation "Rigid lever between two points of a body"
  extends Interfaces.PartialTwoFrames;
  parameter Units.Length r[3] "From frame_a to frame_b, at rest";
equation
  frame_b.r_0 = frame_a.r_0 + r + cross(frame_a.phi, r);
  frame_b.phi = frame_a.phi;
  frame_a.f + frame_b.f = zeros(3);
  frame_a.t + frame_b.t + cross(r, frame_b.f) = zeros(3);
end FixedTranslation;
