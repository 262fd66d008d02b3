within WheelsetRig.Brakes;
model NoActuation "Null version: the pads never touch"
  extends PartialActuation;
equation
  Fperp = 0.0;
end NoActuation;
