within WheelsetRig.Parts;
model BrakeUnit "Calliper that bounces and pitches on the bogie frame"
  extends Interfaces.PartialTwoFrames;
  parameter Units.Mass m(min=1.0) "Mass";
  parameter Units.Inertia J(min=0.1) "Moment of inertia about the pivot";
  parameter Units.Length lB "From the pivot forward to the pads; negative: pads behind it";
  parameter Units.Length lC = 0.0 "From the pivot forward to the centre of gravity";
  parameter Units.Stiffness c "Stiffness of the suspension, vertical";
  parameter Units.Damping d "Damping of the suspension, vertical";
  parameter Units.RotationalStiffness cPitch "Stiffness of the suspension, pitch";
  parameter Units.RotationalDamping dPitch "Damping of the suspension, pitch";
  outer World world;
  Joints.Prismatic bounce(n={0, 0, 1}) "zB"
    annotation (Placement(transformation(extent={{-80,-10},{-60,10}})));
  Joints.Revolute pitch(n={0, 1, 0}) "betaB"
    annotation (Placement(transformation(extent={{-50,-10},{-30,10}})));
  Forces.Bushing suspension(
    c={0.0, 0.0, c}, d={0.0, 0.0, d}, cRot={0.0, cPitch, 0.0}, dRot={0.0, dPitch, 0.0},
    f0={0.0, 0.0, m*world.g}, t0={0.0, -m*world.g*lC, 0.0}) "Carries the weight at rest"
    annotation (Placement(transformation(extent={{-65,30},{-45,50}})));
  FixedTranslation toCenter(r={lC, 0.0, 0.0})
    annotation (Placement(transformation(extent={{0,-50},{20,-30}})));
  FixedTranslation toPads(r={lB, 0.0, 0.0})
    annotation (Placement(transformation(extent={{40,-10},{60,10}})));
  Body body(m=m, I={J - m*lC^2, J - m*lC^2, J - m*lC^2})
    annotation (Placement(transformation(extent={{40,-50},{60,-30}})));
  Units.Energy energy = body.energy + suspension.energy "Energy of body and suspension";
  Units.Power lossPower = suspension.lossPower "Power turned into heat, never negative";
equation
  connect(frame_a, bounce.frame_a);
  connect(bounce.frame_b, pitch.frame_a);
  connect(frame_a, suspension.frame_a);
  connect(pitch.frame_b, suspension.frame_b);
  connect(pitch.frame_b, toCenter.frame_a);
  connect(toCenter.frame_b, body.frame_a);
  connect(pitch.frame_b, toPads.frame_a);
  connect(toPads.frame_b, frame_b);
end BrakeUnit;
