within WheelsetRig.Parts;
model World "Gravity, and the origin: the centre of the loaded axle at rest"
  parameter Units.Acceleration g = 9.81 "Gravity, downwards";
  Interfaces.Frame frame_b annotation (Placement(transformation(extent={{90,-10},{110,10}})));
equation
  frame_b.r_0 = zeros(3);
  frame_b.phi = zeros(3);
  annotation (
    defaultComponentName="world", defaultComponentPrefixes="inner",
    missingInnerMessage="Bodies need gravity: declare 'inner Parts.World world' around them");
end World;
