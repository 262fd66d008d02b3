within WheelsetRig.Interfaces;
connector Flange "Shaft that spins about the axle, positive in forward rotation"
  Units.Angle phi "Angle of the shaft";
  flow Units.Torque tau "Cut torque acting on the component";
  annotation (Icon(graphics={Ellipse(extent={{-100,100},{100,-100}}, fillPattern=FillPattern.Solid)}));
end Flange;
