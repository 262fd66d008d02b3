within WheelsetRig.Brakes;
model ConstantPadFriction "Null version: friction does not depend on anything"
  extends PartialPadFriction;
equation
  mu = level;
end ConstantPadFriction;
