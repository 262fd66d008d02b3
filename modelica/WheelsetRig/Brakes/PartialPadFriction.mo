within WheelsetRig.Brakes;
partial model PartialPadFriction "Slot: friction coefficient between disc and pad of one brake unit"
  input Units.FrictionCoefficient level "Friction coefficient, as set by model and observer";
  input Units.Force Fperp "Normal force of the unit";
  input Units.Velocity v "Sliding velocity at the pad";
  input Units.Temperature TBefore = 333.15 "Temperature of the discs before the stop";
  input Units.FrictionCoefficient lackBefore = 0.0 "Lack of one disc, from earlier in a chain";
  output Units.FrictionCoefficient mu "Friction coefficient that acts, mean of all discs";
  output Units.FrictionCoefficient lack = lackBefore
    "What the disc that brakes least lacks of the mean; of laws that hold for all, nothing more";
end PartialPadFriction;
