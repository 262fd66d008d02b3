within CascadedTanks.Slots;
model Tank "Null version: upright walls"
  extends PartialTank;
equation
  actual = nominal;
end Tank;
