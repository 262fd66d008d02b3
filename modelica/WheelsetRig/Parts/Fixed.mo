within WheelsetRig.Parts;
model Fixed "Point of the rigid mounting"
  parameter Units.Length r[3] "Position in the world";
  Interfaces.Frame frame_b annotation (Placement(transformation(extent={{90,-10},{110,10}})));
equation
  frame_b.r_0 = r;
  frame_b.phi = zeros(3);
end Fixed;
