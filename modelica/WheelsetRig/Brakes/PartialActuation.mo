within WheelsetRig.Brakes;
partial model PartialActuation "Slot: from cylinder pressure to the normal force of one brake unit"
  input Units.Pressure pB "Cylinder pressure";
  output Units.Force Fperp "Normal force of one unit, sum of both pads";
end PartialActuation;
