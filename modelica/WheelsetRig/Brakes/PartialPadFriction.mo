within WheelsetRig.Brakes;
partial model PartialPadFriction "Slot: friction coefficient between disc and pad of one brake unit"
  input Units.FrictionCoefficient level "Friction coefficient, as set by model and observer";
  input Units.Force Fperp "Normal force of the unit";
  input Units.Velocity v "Sliding velocity at the pad";
  output Units.FrictionCoefficient mu "Friction coefficient that acts";
end PartialPadFriction;
