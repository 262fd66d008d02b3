within ServoPendulum.Drive;
model CurrentLimit "A current that is limited"
  extends Common.Signals.Saturation(width=0.05, high(unit="A", min=0.2, max=5.0), share(max=1.0));
  annotation (
    __Workbench(effect(
      size="share", step=0.1, matters=0.1, shapes(high={1.0, 1.5}), slots={"current"},
      separation="the torque with the shaft blocked, over the duty")),
    Documentation(info="<html>
<p>The servo's own limit, or that of its supply. It is set to 1.75 A when such servos leave the
works; in position mode many have none.</p>
</html>"));
end CurrentLimit;
