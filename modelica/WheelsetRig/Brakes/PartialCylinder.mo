within WheelsetRig.Brakes;
partial model PartialCylinder "Slot: from the measured pressure to the one that presses the pads"
  input Units.Pressure pB "Measured pressure";
  input Units.Pressure restBefore "Reading on an empty cylinder, from earlier in a chain";
  output Units.Pressure p "Pressure that presses the pads";
  output Units.Pressure rest "What the sensor reads on an empty cylinder";
end PartialCylinder;
