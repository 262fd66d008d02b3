within WheelsetRig.Forces;
model SpringDamper "Spring and damper along one axis, with preload"
  extends Interfaces.PartialForce;
  parameter Integer n[3] "Axis: one of x, y, z";
  parameter Units.Stiffness c "Stiffness";
  parameter Units.Damping d "Damping";
  parameter Units.Force F0 = 0.0 "Force at rest";
  Units.Force F "Force along n on the body at frame_b";
  Units.Length s "Displacement";
  Units.Velocity ds "Its rate";
equation
  s = n*(frame_b.r_0 - frame_a.r_0);
  ds = der(s);
  F = F0 - c*s - d*ds;
  frame_b.f = -n*F;
  frame_b.t = zeros(3);
  energy = 0.5*c*s^2 - F0*s;
  lossPower = d*ds^2;
end SpringDamper;
