within CascadedTanks.Slots;
model Signal "Null version: the nominal value acts"
  extends PartialSignal;
equation
  y = u;
end Signal;
