within WheelsetRig.Forces;
model Torque "Torque on a shaft"
  input Units.Torque tau "Torque on the shaft";
  Interfaces.Flange flange annotation (Placement(transformation(extent={{90,-10},{110,10}})));
equation
  flange.tau = -tau;
end Torque;
