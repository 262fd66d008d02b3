within WheelsetRig.Interfaces;
connector Frame "Point of a rigid body, with small rotations"
  Units.Length r_0[3] "Position in the world";
  Units.Angle phi[3] "Small rotations about x, y, z of the world";
  flow Units.Force f[3] "Cut force acting on the component";
  flow Units.Torque t[3] "Cut torque acting on the component";
  annotation (Icon(graphics={Rectangle(extent={{-100,100},{100,-100}}, fillPattern=FillPattern.Solid)}));
end Frame;
