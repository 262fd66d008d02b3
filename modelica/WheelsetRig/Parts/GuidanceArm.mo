within WheelsetRig.Parts;
model GuidanceArm "Arm that pitches on the bogie frame and guides an axle box"
  extends Interfaces.PartialTwoFrames;
  parameter Units.Mass m(min=1.0) "Mass";
  parameter Units.Inertia J(min=0.1) "Moment of inertia about the pivot";
  parameter Units.Length l "From the axle box forward to the pivot; negative: pivot behind it";
  Joints.Revolute pitch(n={0, 1, 0}) "betaG"
    annotation (Placement(transformation(extent={{-70,-10},{-50,10}})));
  FixedTranslation toCenter(r={-l/2.0, 0.0, 0.0})
    annotation (Placement(transformation(extent={{-20,-50},{0,-30}})));
  FixedTranslation toBox(r={-l, 0.0, 0.0})
    annotation (Placement(transformation(extent={{30,-10},{50,10}})));
  Body body(m=m, I={0.1*JC, JC, JC}) "Slender"
    annotation (Placement(transformation(extent={{30,-50},{50,-30}})));
  Units.Energy energy = body.energy "Kinetic energy and energy of position";
protected
  parameter Units.Inertia JC = J - m*(l/2.0)^2 "Moment of inertia about the centre of gravity";
equation
  connect(frame_a, pitch.frame_a);
  connect(pitch.frame_b, toCenter.frame_a);
  connect(pitch.frame_b, toBox.frame_a);
  connect(toCenter.frame_b, body.frame_a);
  connect(toBox.frame_b, frame_b);
end GuidanceArm;
